"""What the symmetry of an even ring expects: a skin that is the same all round looks the same from every electrode, so
that readings whose drive and pair are turned into each other are one function of the place, turned.

Reading i, which is kind c(i) turned by k(i) steps, has the pattern g_i h_c(R^-k p) + noise at place p of a disc about
the middle. h_c has a Matern-5/2 kernel, so that every press teaches it at as many places as there are electrodes; gains
g_i, of root mean square 1 in each kind, are found in turns with it. The covariance of one press under all turns is
circulant: the discrete Fourier transform over the turns splits it into a matrix of the presses for each harmonic.
Nothing is said of the fields, so that the layer may have any thickness and law, and the instrument any error that all
channels share. Middle, direction of counting, length and noise are those of the least error of presses left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize

from eitsim.scene.drive import Protocol
from surrogate.recordings.pattern_process import Expected, matern
from surrogate.recordings.patterns import centred
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Complex, Index

MOST_PRESSES = 60  # that it is learnt from, evenly spread
LENGTHS, NOISES = (0.45, 0.7, 1.0, 1.4, 2.0), (0.1, 0.3, 1.0)  # over the spread of the places; of noise, variances
FIRST = 1.0, 0.3  # length and noise by which the middle and the direction of counting are looked for
MOVE, MOST_MOVES = 0.15, 30  # of the middle: the first, over the spread of the places, and most
ROUNDS = 4  # of gains and functions
RIDGE = 0.1  # of the mean information on a gain


@dataclass(frozen=True, eq=False)
class _Settings:
    middle: complex  # mm
    mirrored: bool  # electrodes count clockwise
    length: float  # over the spread of the places
    noise: float  # variance over that of the functions


@dataclass(frozen=True, eq=False)
class _Found:
    settings: _Settings
    error: float  # part of the patterns' variance that is missed of presses that are left out
    weights: Array  # (kinds, turns, n) of the kernels about the turned places
    left_out: Array  # (kinds, turns, n) the functions at the places, each without its press


@dataclass(frozen=True, eq=False)
class RingSymmetry:
    """The symmetry of a protocol's readings."""

    protocol: Protocol
    columns: Index | None = None  # readings of the protocol that make up a pattern, all of them first; None: all

    def taking(self, columns: Index) -> "RingSymmetry":
        """The symmetry of patterns of these readings."""
        return replace(self, columns=columns)

    @cached_property
    def turned(self) -> tuple[Index, Index]:
        """(m,) kind of each reading, -1 where a turn of it is not read, and steps by which it is turned."""
        count = self.protocol.currents_A.shape[1]
        readings = np.stack([np.repeat(self.protocol.currents_A, self.protocol.shape[1], axis=0),
                             self.protocol.weights.reshape(-1, count)], axis=1).round(9)
        first: dict[bytes, tuple[int, int]] = {}
        kind, turn = np.empty((2, len(readings)), np.intp)
        for i, reading in enumerate(readings):
            known = first.get(reading.tobytes())
            if known is None:
                known = i, 0
                first.update({np.roll(reading, k, axis=1).tobytes(): (i, k) for k in range(count)})
            kind[i], turn[i] = known
        whole = np.array([len(set(turn[kind == one])) == np.sum(kind == one) == count for one in kind])
        kind[~whole] = -1
        return np.unique(kind, return_inverse=True)[1] - int((~whole).any()), turn

    def learn(self, pattern: Array, place: Array) -> Expected:
        """What it expects up to gains, learnt from patterns (n, m) at places (n, 2), mm."""
        kind, turn = self.turned
        used, all_columns = kind >= 0, np.arange(len(kind)) if self.columns is None else self.columns
        if not used.any():
            return Expected(lambda there: np.zeros((len(there), len(all_columns))))
        once = np.unique(place, axis=0, return_index=True)[1]
        rows = np.sort(once)[spread_evenly(len(once), MOST_PRESSES)]
        z, spread = _complex(place[rows]), float(np.sqrt(place[rows].var(axis=0).mean()))
        seen = np.zeros((kind.max() + 1, self.protocol.currents_A.shape[1], len(rows)))
        seen[kind[used], turn[used]] = centred(pattern[rows][:, :len(kind)])[:, used].T
        found = _searched(seen, z, complex(*(place.min(axis=0) + place.max(axis=0)) / 2), spread)
        settings = found.settings
        learnt_at = _turns(_on_disc(z, settings, spread), seen.shape[1])
        # of each reading, the weights of all kernels as it is turned
        rolled = np.stack([np.roll(found.weights[c], -k, axis=0).ravel() for c, k in zip(
            kind[used], turn[used], strict=True)], axis=1)

        def at(there: Array) -> Array:
            kernel = matern(_plane(_on_disc(_complex(there), settings, spread)), learnt_at, settings.length)
            out = np.zeros((len(there), len(kind)))
            out[:, used] = kernel @ rolled
            return out[:, all_columns]

        held = at(place)
        own = np.zeros((len(rows), len(kind)))
        own[:, used] = found.left_out[kind[used], turn[used]].T
        same = (place[:, None] == place[rows]).all(axis=2)
        held[same.any(axis=1)] = own[same.argmax(axis=1)[same.any(axis=1)]][:, all_columns]
        return Expected(at, held)


def _searched(seen: Array, z: Complex, middle: complex, spread: float) -> _Found:
    """The settings of least error of patterns (kinds, turns, n) at places (n,), mm."""
    def best(each: Sequence[_Settings]) -> _Found:
        return min((_left_out(seen, z, spread, one) for one in each), key=lambda found: found.error)

    found = best([_Settings(middle, mirrored, *FIRST) for mirrored in (False, True)])

    def moved(by: Array) -> _Settings:
        return replace(found.settings, middle=found.settings.middle + spread * complex(*by))

    by = minimize(lambda by: _left_out(seen, z, spread, moved(by)).error, np.zeros(2), method="Nelder-Mead", options={
        "initial_simplex": MOVE * np.array([[0, 0], [1, 0], [0, 1]]), "maxfev": MOST_MOVES}).x
    found = best([found.settings, moved(by)])
    return best([replace(found.settings, length=length, noise=noise) for length in LENGTHS for noise in NOISES])


def _left_out(seen: Array, z: Complex, spread: float, settings: _Settings) -> _Found:
    """The functions and gains of settings; K^-1 y over its block's diagonal is what is missed (equation 5.12 of
    Rasmussen and Williams), harmonic by harmonic."""
    place = _on_disc(z, settings, spread)
    turned = _turns(place, seen.shape[1])
    kernel = matern(turned, _plane(place), settings.length).reshape(seen.shape[1], len(z), len(z))
    spectrum = np.fft.fft(kernel, axis=0) + settings.noise * np.eye(len(z))
    inverse = np.linalg.inv((spectrum + np.conj(spectrum.swapaxes(1, 2))) / 2)
    diagonal = np.diagonal(inverse, axis1=1, axis2=2).real
    gains = own = np.ones((*seen.shape[:2], 1))
    weighted = left_out = seen
    for _ in range(ROUNDS):
        y = np.fft.fft(gains * seen, axis=1)
        weighted = (inverse @ y.transpose(1, 2, 0)).transpose(2, 0, 1)
        left_out = np.fft.ifft(y - weighted / diagonal, axis=1).real
        information = np.sum(left_out**2, axis=2, keepdims=True)
        own = np.sum(left_out * seen, axis=2, keepdims=True) / np.maximum(
            information + RIDGE * information.mean(), np.finfo(float).tiny)
        gains = own / np.maximum(np.sqrt(np.mean(own**2, axis=1, keepdims=True)), np.finfo(float).tiny)
    missed = float(np.sum((seen - own * left_out) ** 2) / max(np.sum(seen**2), np.finfo(float).tiny))
    return _Found(settings, missed, np.fft.ifft(weighted, axis=1).real, left_out)


def _on_disc(z: Complex, settings: _Settings, spread: float) -> Complex:
    """Places (n,), mm, about the middle, over the spread, electrodes counted counter-clockwise."""
    found = (z - settings.middle) / spread
    return np.conj(found) if settings.mirrored else found


def _turns(place: Complex, count: int) -> Array:
    """(count n, 2) places (n,) turned back by every step of the ring."""
    return _plane((np.exp(-2j * np.pi * np.arange(count) / count)[:, None] * place).ravel())


def _complex(place: Array) -> Complex:
    return np.asarray(place[:, 0] + 1j * place[:, 1], np.complex128)


def _plane(place: Complex) -> Array:
    return np.stack([place.real, place.imag], axis=-1)
