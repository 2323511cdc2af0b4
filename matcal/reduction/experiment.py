"""A reduced experiment: what every reader and protocol ends in and every fit begins with."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from matcal.readers.vocabulary import KINDS
from touchcal.arrays import Array

CROSSED_S = "path_crosses_s"  # fact of a path that crosses rest and whose clock was left out: the time of a loading
NO_UNLOADING = "no_unloading"  # fact of a test of which unloading was asked for and which has none
_OTHER_SIDE = 0.02  # share of the largest strain up to which a path may cross rest
_UNLOADED = 0.9  # share of the largest strain below which unloading counts
_OPTIONAL = ("time_s", "samples", "deviation", "lateral", "held")


@dataclass(frozen=True)
class Sweep:
    """What a dynamic test has next to its storage modulus, the `value` of its experiment."""

    frequency_Hz: Array  # (n,) frequencies
    loss_Pa: Array  # (n,) loss modulus
    group: NDArray[np.intp]  # (n,) sweep of each row, one a temperature, by increasing temperature
    temperature_K: Array  # (m,) mean temperature of each sweep; empty where the file has none


@dataclass(frozen=True)
class StrainPath:
    """Loading and unloading of a cyclic test, from first contact on."""

    strain: Array  # (n,) nominal strain, compression negative
    stress_Pa: Array  # (n,) nominal stress
    time_s: Array | None  # (n,) time from contact, s; None without a clock
    noise_Pa: float  # standard deviation of the noise of a value

    @property
    def unloads(self) -> bool:
        """Whether the strain falls clearly below the largest one before it."""
        size = np.abs(self.strain)
        return bool(np.any(size < _UNLOADED * np.maximum.accumulate(size)))

    @property
    def crosses(self) -> bool:
        """Whether it goes through rest to strains that its first loading, which is of one side, does not reach."""
        low, high = sorted(np.abs([self.strain.min(), self.strain.max()]))
        return bool(self.strain.min() < 0 < self.strain.max() and low > _OTHER_SIDE * high)

    @property
    def timed(self) -> bool:
        """Whether its history can be convolved."""
        return self.time_s is not None and not self.crosses


@dataclass(frozen=True)
class Experiment:
    """One specimen in one mode; a relaxation has time and stress, a creep time and compliance, a dynamic test storage
    modulus and a sweep, a conductivity test strain and conductivity."""

    kind: str  # one of KINDS
    strain: Array  # (n,) nominal strain, compression negative (gamma for shear, J for volumetric)
    # (n,) nominal stress, Pa, compression negative (minus pressure for volumetric); conductivity: c, S/m; creep: J,
    # 1/Pa; dynamic test: storage modulus, Pa
    value: Array
    # (n,) time from the start of loading, s; None where the file has no clock (then no rate correction is possible)
    time_s: Array | None = None
    source: tuple[str, ...] = ()  # file name(s) it came from
    # standard deviation of the noise of `value`, same unit, estimated from the record; None where it cannot be
    noise: float | None = None
    # (n,) raw samples averaged into each value, where these differ: `noise` is then that of one sample and value k has
    # noise/sqrt(samples[k]); None where every value has the same noise
    samples: Array | None = None
    # (n,) scatter of `value` from specimen to specimen where the file states it, same unit; None where it does not
    deviation: Array | None = None
    # (n,) nominal strain of the free faces, measured in a uniaxial, planar or biaxial test; None where it was not
    lateral: Array | None = None
    # (n,) 1 where the strain of a relaxation is held, 0 on the ramps between the holds; None where nothing is held
    held: Array | None = None
    # column -> (m,) values, one row a cycle, of a cyclic test: cycle, resistance_rest_Ohm, resistance_peak_Ohm, their
    # fitted courses fit_*; or cycle, loss_Pa, residual_strain, peak_stress_Pa. None where nothing is cycled
    cycles: Mapping[str, Array] | None = None
    path: StrainPath | None = None  # the whole path of a test of which `strain` and `value` are the first loadings
    sweep: Sweep | None = None  # of a dynamic test; None for any other
    decisions: tuple[str, ...] = ()  # every correction applied and decision taken, one sentence each, in order
    cautions: tuple[str, ...] = ()  # what a user of the card must know of the record, one sentence each
    # further numbers of the reduction, units in the names (offset_N, compliance_mm_per_N, clock_shift_s, ...)
    facts: Mapping[str, float] = field(default_factory=dict)
    files: tuple[Path, ...] = ()  # every file that was read for it, sizes included; empty for arrays
    standards: tuple[str, ...] = ()  # that the lines above its tables name
    layout: str = ""  # names of the readers that recognised its files, joined by commas; empty for arrays

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"experiment kind '{self.kind}' is unknown; known: {', '.join(KINDS)}.")
        for name in ("strain", "value", *_OPTIONAL):
            if (value := getattr(self, name)) is not None:
                value = np.array(value, dtype=float)
                value.setflags(write=False)
                object.__setattr__(self, name, value)
        if self.cycles is not None:
            object.__setattr__(self, "cycles", _table(self.kind, self.cycles))
        others = (getattr(self, name) for name in _OPTIONAL)
        sizes = {self.strain.size, self.value.size, *(a.size for a in others if a is not None)}
        if len(sizes) != 1 or self.strain.ndim != 1:
            raise ValueError(f"experiment '{self.kind}': strain, value, {', '.join(_OPTIONAL)} must have one length, "
                             f"got {sizes}.")


def _table(kind: str, columns: Mapping[str, Array]) -> Mapping[str, Array]:
    out = {name: np.array(values, dtype=float, ndmin=1) for name, values in columns.items()}
    if len({values.shape for values in out.values()}) > 1:
        raise ValueError(f"experiment '{kind}': the columns of its cycles must have one length, got "
                         f"{', '.join(f'{name} {values.size}' for name, values in out.items())}.")
    for values in out.values():
        values.setflags(write=False)
    return out
