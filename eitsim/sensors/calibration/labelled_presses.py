"""What labelled presses say of the signal: its size, and where no absolute model is usable a gain for each reading.

A press k at a known place changes reading i by A_k g_i s_i(x_k, y_k), where s is what a small touch changes on the
untouched sensor (`small_touch`), A_k, mm^2, the relative change of conductance over the press's area, and g_i a gain.
ln|A_k| is normal about ln_moment_mm2, whose prior is wide. Gains have mean 1, so that A alone holds the unit.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.sensors.calibration.placement import Placement
from eitsim.sensors.labels import Labels, places_of
from eitsim.sensors.reading_checks import dead_readings, mean_frame
from eitsim.sensors.recording import Recording
from touchcal.arrays import Array, Index, Mask
from touchcal.errors import InputFileError

GAIN_SD = 0.3  # prior of a reading's gain about 1
MOMENT_SD = 10.0  # prior of ln_moment_mm2: nothing is known but what the signals say
FEWEST = 4  # presses, so that there are two in each half
_ROUNDS = 20
_CLEARLY = 2.0  # standard errors by which presses that were not fitted must be better explained


@dataclass(frozen=True, eq=False)
class Presses:
    """Labelled presses."""

    place_m: Array  # (k, 2)
    signal: Array  # (k, m) touched less untouched readings, NaN where dead
    rows: Index  # (k,) which of the labels they are


@dataclass(frozen=True, eq=False)
class SignalSize:
    """What the presses gave."""

    presses: int
    lies: Placement  # where the sensor lies in the coordinates of the labels
    moments_mm2: Array  # (k,) A_k; of readings in counts by the board's factor
    gain: Array  # (m,) gain of each reading, 1 where none is fitted
    gain_sd: Array  # (m,) its standard deviation, GAIN_SD where none is fitted
    gains_kept: bool  # whether presses that were not fitted are clearly better explained with gains
    fitted: float  # part of the norm of the signals that is left, without gains and
    held_out: float  # the same on presses that were not fitted, a half by chance; their moments are
    fitted_gains: float  # with them
    held_out_gains: float

    @property
    def sign(self) -> float:
        """Whether most presses make the skin more or less conductive."""
        return 1.0 if np.sum(self.moments_mm2 > 0) >= np.sum(self.moments_mm2 < 0) else -1.0

    @property
    def ln_moment(self) -> tuple[float, float]:
        """Mean of ln|A| over the presses of that sign, and its standard deviation."""
        logarithm = np.log(np.abs(self.moments_mm2[self.sign * self.moments_mm2 > 0]))
        sd = float(np.std(logarithm, ddof=1) / np.sqrt(len(logarithm))) if len(logarithm) > 1 else MOMENT_SD
        return float(logarithm.mean()), min(sd, MOMENT_SD)


def labelled_presses(recording: Recording, labels: Labels) -> Presses:
    """The labelled touches of a recording, the mean of their frames less the untouched frame that came last before
    them, or first after; ValueError where fewer than four have a place, InputFileError where none is untouched."""
    frames = np.real(recording.readings)
    rest = np.flatnonzero(recording.untouched)
    if recording.kind != "difference" and not len(rest):
        raise InputFileError(recording.source, "no frame is untouched; leave `touch` empty in rows without a touch.")
    place, row = places_of(labels), {name: k for k, name in enumerate(labels.touch.tolist())}
    names = [name for name in dict.fromkeys(recording.touch.tolist()) if name in row]
    if len(names) < FEWEST:
        raise ValueError(f"{len(names)} touches of the recording have a label, and {FEWEST} are the fewest. Name "
                         "touches as the recording does.")
    signals = []
    for name in names:
        rows = np.flatnonzero(recording.touch == name)
        before = rest[rest < rows[0]][-1:] if np.any(rest < rows[0]) else rest[:1]
        base = 0.0 if recording.kind == "difference" else frames[before[0]]
        signals.append(mean_frame(frames[rows] - base))
    signal = np.array(signals)
    signal[:, dead_readings(recording)] = np.nan
    held = np.array([row[name] for name in names])
    return Presses(1e-3 * place[held], signal, held)


def signal_size(presses: Presses, there: Mask, shape: Array, lies: Placement, seed: int, *,
                gains: bool) -> SignalSize:
    """Sizes of the presses' signals, and gains where they are asked for and explain presses that were not fitted.

    there: (m,) readings that all presses have; shape: (k, of these) s at the places of the presses, by mm^2; lies:
    where these are.
    """
    signal = presses.signal[:, there]
    one = np.ones(shape.shape[1])
    half = np.random.default_rng(seed).permutation(len(signal)) % 2 == 0
    seen, _ = _gains(signal[half], shape[half])
    fitted, sd = _gains(signal, shape) if gains else (one, np.full(len(one), GAIN_SD))
    parts = [_left(signal[rows], shape[rows] * gain) for gain in (one, seen) for rows in (half, ~half)]
    left = [float(np.sqrt(part.sum())) for part in parts]
    better = parts[1] - parts[3]
    kept = gains and float(better.sum()) > _CLEARLY * float(np.std(better, ddof=1)) * np.sqrt(len(better))
    gain, gain_sd = np.ones(len(there)), np.full(len(there), GAIN_SD)
    if kept:
        gain[there], gain_sd[there] = fitted, sd
    return SignalSize(len(signal), lies, _moments(signal, shape * gain[there]), gain, gain_sd, kept, *left)


def _gains(signal: Array, shape: Array) -> tuple[Array, Array]:
    """Gains (m,) and their standard deviations by turns with the moments, all readings of one weight."""
    gain, sd = np.ones(shape.shape[1]), np.full(shape.shape[1], GAIN_SD)
    for _ in range(_ROUNDS):
        model = _moments(signal, shape * gain)[:, None] * shape
        variance = float(np.mean((signal - model * gain) ** 2))
        weight = np.sum(model**2, axis=0) / variance + 1 / GAIN_SD**2
        gain = (np.sum(model * signal, axis=0) / variance + 1 / GAIN_SD**2) / weight
        gain, sd = gain / gain.mean(), weight**-0.5
    return gain, sd


def _moments(signal: Array, shape: Array) -> Array:
    return np.sum(signal * shape, axis=1) / np.sum(shape**2, axis=1)


def _left(signal: Array, shape: Array) -> Array:
    """(k,) squared 2-norm of what is left of each press, over that of all."""
    left = signal - _moments(signal, shape)[:, None] * shape
    return np.sum(left**2, axis=1) / np.sum(signal**2)


