"""What a table of load paths is made for and what it holds, as data."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.load_paths.load_path import Deviation
from touchcal.arrays import Array


@dataclass(frozen=True)
class DimensionlessProblem:
    """What a table is made for: lengths over the thickness, moduli over mu_0."""

    law: str  # its name
    parameters: tuple[tuple[float, ...], ...]  # of the law
    disc: float  # radius of the disc
    fillet: float
    diameters: tuple[float, ...]  # increasing diameters: the ends of a range, or all there are
    spans: bool  # whether every diameter between the ends is served
    # whether touches lie on skins with an outline and near a straight edge, if near any: they are those of a disc whose
    # rim is far from all
    straight: bool = False

    @property
    def solved(self) -> tuple[float, ...]:
        """Diameters whose paths are solved: of a range, Chebyshev points of the logarithm with the ends."""
        if not self.spans:
            return self.diameters
        low, high = np.log(self.diameters)
        count = 2 + int(np.ceil(3 * (high - low)))
        points = (low + high) / 2 - (high - low) / 2 * np.cos(np.pi * np.arange(count) / (count - 1))
        return tuple(np.exp(points).tolist())

    @property
    def base(self) -> float:
        """The middle one of the solved diameters, whose mesh gives the radii and whose path the depths."""
        return self.solved[len(self.solved) // 2]

    @property
    def held_out(self) -> tuple[float, ...]:
        """Diameters at which the table is checked: of a range, in the first and in a middle gap of those solved."""
        solved = self.solved
        if not self.spans:
            return tuple(sorted({solved[0], solved[-1]}))
        middle = len(solved) // 2
        return tuple(float(np.sqrt(solved[i] * solved[i + 1])) for i in sorted({0, middle}))


@dataclass(frozen=True, eq=False)
class RimTable:
    """Changes of the axisymmetric touch by the rim."""

    # all increasing, over the thickness
    diameters: Array
    gaps: Array
    depths: Array
    # (n,) radii of the circles about the middle diameter, over the thickness, and (k,) places on them
    radius: Array
    share: Array
    # (diameters, gaps, depths, n k 7) displacement, metric - (1, 0, 1) and normal - 1 over the depth
    fields: NDArray[np.float32]
    # (diameters, gaps, depths, 9) added depth over the depth, ratios of pressure, area and wall, fraction that is not
    # elliptic, and the errors of
    # depth and signals (by scene.STRAINS) that the rim's own mesh makes
    numbers: Array
    # (gaps - 1, depths, 4) in a cell between neighbouring gaps and between a depth and that before it, the first one
    # from 0 on: how far depth and signals are off changes solved anew; infinite where touches are to be solved anew
    error_estimate: Array
    # (gaps - 1, depths, 4) what was measured of it in the middle of a cell, NaN where nothing was
    measured: Array
    cpu_s: float

    @property
    def error(self) -> Deviation:
        """Largest deviation in the cells whose touches are served."""
        served = self.error_estimate[np.isfinite(self.error_estimate).all(axis=-1)]
        depth, *signals = served.max(axis=0, initial=0.0).tolist()
        return Deviation(depth, np.array(signals), 0.0)


@dataclass(frozen=True, eq=False)
class Table:
    """Touches of a shape over force and diameter."""

    shape: DimensionlessProblem
    depths: Array  # (k,) depths, before the correction for penetration
    radius: Array  # (r,) reference radii about the middle one of the solved diameters
    # (diameters, k, 6 r + 6) FIELDS and NUMBERS, and their derivatives by the depth
    values: Array
    slopes: Array
    error_estimate: Array  # (diameters, k, 11) ERRORS
    error: Deviation  # largest deviation from touches solved anew at held-out depths and diameters
    checks: int  # how many those were
    cpu_s: float  # CPU time that it took, s
    rim: RimTable | None = None  # what the rim changes of these touches; None where that is solved anew

    @property
    def whole_cpu_s(self) -> float:
        """CPU time that it took with what the rim changes, s."""
        return self.cpu_s + (0.0 if self.rim is None else self.rim.cpu_s)
