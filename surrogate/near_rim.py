"""Learning what the rim adds to the series: the skin's answer, what electrodes add, a step, and the error of all."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from surrogate import multipole, polarization, rim_effect, rim_error, step
from surrogate.rim_effect import RimEffect
from surrogate.rim_error import RimError
from surrogate.ring import Ring
from surrogate.shared_process import SharedProcess

Array = NDArray[np.float64]

# Rows whose effect is worked out together, to bound the memory.
BATCH = 256
# Parts of the rows, each of which tells the error of what the others teach.
FOLDS = 4


@dataclass(frozen=True, eq=False)
class Rows:
    """Touches near the rim, and what the series leaves of their signals."""

    # (n,) place over the disc's radius, (n, 2) log d and load g, (n,) gap to the rim over the radius
    z: NDArray[np.complex128]
    punch: Array
    gap: Array
    # (n, readings) what the series leaves, V
    left: Array
    # (n,) strength of the dipole, the norm of its signal, and that of the whole signal, V
    dipole: Array
    size: Array
    norm: Array

    def some(self, kept: NDArray[np.bool_]) -> Rows:
        """Those that are kept."""
        return Rows(*(getattr(self, name)[kept] for name in self.__dataclass_fields__))


@dataclass(frozen=True, eq=False)
class Taught:
    """What the rim adds."""

    polarization: SharedProcess
    rim: RimEffect
    error: RimError
    # gap over the disc's radius where what made the data changes its method; step.NONE where none is seen
    step: float


def none_of(ring: Ring) -> Taught:
    """Nothing."""
    rim = rim_effect.none_of(ring)
    return Taught(polarization.none_of(), rim, rim_error.none_of(rim.symmetry), step.NONE)


def without(taught: Taught, ring: Ring, kept: NDArray[np.bool_]) -> Taught:
    """What the rim adds to the readings of a ring that are kept."""
    return replace(taught, rim=rim_effect.without(taught.rim, ring, kept), error=rim_error.without(taught.error, kept))


def learn(ring: Ring, field: Array, rows: Rows) -> Taught:
    """Learn from touches; the effect of electrodes and an error only where enough of them lie near the rim."""
    near = rows.some(np.abs(rows.z) > polarization.FROM)
    answer = _answer(ring, field, near, step.NONE)
    where = rim_effect.step_of(ring, near.z, near.punch, near.gap, _leaves(ring, field, near, answer, step.NONE),
                               near.size)
    answer, rim = _both(ring, field, near, where)
    if not rim_effect.teaches(rim):
        return Taught(answer, rim, rim_error.none_of(rim.symmetry), where)
    told = rim_error.told_by(rim.symmetry, near.z, near.gap, near.punch[:, 1], _left_out(ring, field, near, where))
    return Taught(answer, rim, told, where)


def _both(ring: Ring, field: Array, near: Rows, where: float) -> tuple[SharedProcess, RimEffect]:
    answer = _answer(ring, field, near, where)
    left = _leaves(ring, field, near, answer, where)
    return answer, rim_effect.learn(ring, near.z, near.punch, step.side(near.gap, where), left, near.size)


def _left_out(ring: Ring, field: Array, near: Rows, where: float) -> Array:
    """(n, readings) errors of the signals, over their norms, by what the rows of the other parts teach."""
    out, part = np.empty_like(near.left), np.arange(len(near.z)) % FOLDS
    for k in range(FOLDS):
        asked = near.some(part == k)
        answer, rim = _both(ring, field, near.some(part != k), where)
        left = _leaves(ring, field, asked, answer, where)
        if rim_effect.teaches(rim):
            effect = rim_effect.effect(rim, asked.z, asked.punch, step.side(asked.gap, where))
            left -= effect.value * asked.size[:, None]
        out[part == k] = left / asked.norm[:, None]
    return out


def _answer(ring: Ring, field: Array, near: Rows, where: float) -> SharedProcess:
    return polarization.learn(ring, field, near.z, near.punch, step.side(near.gap, where), near.left, near.dipole,
                              near.norm)


def _leaves(ring: Ring, field: Array, near: Rows, answer: SharedProcess, where: float) -> Array:
    """(n, readings) what series and polarization leave of the signals, V."""
    left, side = near.left.copy(), step.side(near.gap, where)
    for rows in np.array_split(np.arange(len(near.z)), len(near.z) // BATCH + 1):
        fields = multipole.electrode_fields(ring, field, near.z[rows], polarization.ORDERS + 1)
        effect = polarization.effect(answer, ring, fields, near.z[rows], near.punch[rows], side[rows])
        left[rows] -= effect.value * near.dipole[rows, None]
    return left
