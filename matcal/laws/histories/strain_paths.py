"""Stress along a path of loading and unloading, of any law with what earlier loading left.

The stress is that of the law times eta = 1 - erf((W_max - W)/(m + beta W_max))/r, W the energy of the law and W_max the
largest so far: 1 on first loading, less on unloading and reloading below it (Ogden & Roxburgh, Proc. R. Soc. A 455
(1999) 2861, DOI 10.1098/rspa.1999.0431, with beta as in Abaqus). A loading to the strain e_max leaves the set s e_max:
what was softened runs from there to e_max as the law does from rest, so that it meets first loading at e_max. A loop
takes its share of that stress until loading has come back to where it turned.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PPoly
from scipy.special import erf

from matcal.laws.deformation_modes import nominal_stress, push_forward, second_piola
from matcal.laws.histories.damage import Damage
from matcal.laws.histories.steady_loop import missing
from matcal.laws.law import Law
from matcal.laws.prony import Prony, convolve
from touchcal.arrays import Array

_GRID = 400  # strains of the law's table between rest and the largest of a path
_WORKING = {"biaxial": 2.0}  # axes whose stress does work, 1 in any other mode


@dataclass(frozen=True)
class LawAlong:
    """Stress of a law along one mode as a spline over the strains of a path, and the work from rest."""

    stress_Pa: CubicSpline
    work_Pa: PPoly  # work over the strain, J/m3, 0 at rest but for a constant
    axes: float  # axes whose stress does work

    def at(self, strain: Array) -> tuple[Array, Array]:
        """Stress and work, Pa, at strains (n,)."""
        work = self.work_Pa(strain) - self.work_Pa(0.0)
        return np.asarray(self.stress_Pa(strain)), np.asarray(self.axes * work)


def along(law: Law, mode: str, strain: ArrayLike) -> LawAlong:
    """The law over the strains of a path; ValueError for the volumetric mode, whose strain is J."""
    if mode == "volumetric":
        raise ValueError("a path is followed in uniaxial, biaxial, planar or shear; volumetric tests do not soften.")
    e = np.asarray(strain, dtype=float)
    low, high = min(float(e.min()), 0.0), max(float(e.max()), 1e-6)
    share = np.linspace(0, 1, _GRID) ** 1.5
    grid = np.unique(np.r_[low * share, high * share])
    stress = CubicSpline(grid, nominal_stress(law, mode, grid))
    return LawAlong(stress, stress.antiderivative(), _WORKING.get(mode, 1.0))


def eta(damage: Damage, work_Pa: Array) -> Array:
    """(n,) softening along a path of energies (n,)."""
    most = np.maximum.accumulate(work_Pa)
    return 1 - erf((most - work_Pa) / np.maximum(damage.m_Pa + damage.beta * most, 1e-300)) / damage.r


def effective_strain(strain: Array, set_share: float) -> Array:
    """(n,) strain of the law along a path (n,): counted from the set of each side and stretched to its largest strain;
    0 where the specimen hangs loose."""
    out = np.zeros(strain.size)
    for side in (1.0, -1.0):
        own = np.maximum(side * strain, 0.0)
        most = np.maximum.accumulate(own)
        out += side * np.maximum(own - set_share * most, 0.0) / (1 - set_share)
    return out


def follow(law: Law, mode: str, strain: ArrayLike, damage: Damage | None = None, time_s: ArrayLike | None = None,
           prony: Prony | None = None, table: LawAlong | None = None) -> Array:
    """Nominal stress (n,), Pa, along a path of nominal strains (n,) from rest; at times (n,), s, with the relaxation of
    a series, for which `law` is instantaneous. The stress of the law relaxes, and its softening follows the energy.
    `table`: the law along these strains, where it is known."""
    e = np.asarray(strain, dtype=float)
    table = table or along(law, mode, e)
    effective = effective_strain(e, damage.set_share if damage else 0.0)
    stress, work = table.at(effective)
    if prony is not None and time_s is not None:
        relaxed = convolve(prony, time_s, second_piola(law, mode, effective))
        stress = np.sum(push_forward(mode, effective) * relaxed, axis=-1)
    if damage is None:
        return stress
    softened = eta(damage, work) * stress
    return softened * (1 - damage.loop_share * missing(effective, damage.loop_turn)) if damage.loop_share else softened
