"""Conductivity of a deformed layer, seen from its untouched shape, and what it comes to through the thickness."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eitsim.scene.pressing import Skin
from eitsim.scene.results import Touch
from eitsim.sheet.sheet_conductance import NEAR_RANGE
from matcal.laws.conduction_laws import CUBIC
from matcal.laws.conductivity import Conductivity, conductivity, outside
from touchcal.arrays import Array

# The law of a sheet whose conductance is that of a layer: in proportion to the stretch normal to it.
_IN_PROPORTION = (1.0, 0.0, 0.0)


def volume_strain(skin: Skin, metric: Array) -> Array:
    """Strain (...) of metrics C (..., 3, 3) that drives a layer's conductivity: the change of volume, or the largest
    principal strain."""
    if skin.strain == "volume":
        return np.sqrt(np.linalg.det(metric)) - 1
    return np.sqrt(np.linalg.eigvalsh(metric)[..., -1]) - 1


def referred_conductivity(law: Conductivity, skin: Skin, gradient: Array) -> Array:
    """J F^-1 s F^-T (..., 3, 3), S/m, of deformation gradients F (..., 3, 3): what a layer conducts on its untouched
    shape.

    Isotropic, s = c(e), it is J c C^-1. A piezoresistive layer has the resistivity ln(rho_i/rho_0) = along h_i + across
    (h_j + h_k) along each principal direction of the logarithmic strains h, which is J^(1 - across) C^(-1 - (along -
    across)/2)/rho_0. NotPositive where c(e) is not positive.
    """
    metric = np.swapaxes(gradient, -1, -2) @ gradient
    volume = np.linalg.det(gradient)[..., None, None]
    if skin.strain != "piezoresistive":
        return volume * conductivity(law, volume_strain(skin, metric))[..., None, None] * np.linalg.inv(metric)
    squared, axes = np.linalg.eigh(metric)
    power = squared ** (-1 - (skin.along - skin.across) / 2)
    return law.c0_S_per_m * volume ** (1 - skin.across) * (axes * power[..., None, :]) @ np.swapaxes(axes, -1, -2)


def without_cross_current(sigma: Array, through: int) -> Array:
    """In-plane conductivities (..., 2, 2) of tensors (..., 3, 3) where no current crosses the layer along axis
    `through`: the inverse of the in-plane part of the resistivity."""
    plane = [axis for axis in range(3) if axis != through]
    cross = sigma[..., plane, through]
    return (sigma[..., plane, :][..., plane] - cross[..., :, None] * cross[..., None, :]
            / sigma[..., through, through][..., None, None])


def strained_outside(law: Conductivity, skin: Skin, gradient: Array) -> NDArray[np.bool_]:
    """Where (...) deformation gradients strain a layer outside the range of its conductivity's fit, by more than
    NEAR_RANGE."""
    strain = volume_strain(skin, np.swapaxes(gradient, -1, -2) @ gradient)
    return outside(law, strain) & outside(law, strain - NEAR_RANGE) & outside(law, strain + NEAR_RANGE)


def sheet_law(law: Conductivity) -> Conductivity:
    """The law of `as_sheet_touch`."""
    return replace(law, a=np.array(_IN_PROPORTION), kind=CUBIC)


def sheet_skin(skin: Skin) -> Skin:
    """The coating of `as_sheet_touch`."""
    return Skin(skin.thickness_m, "normal")


def as_sheet_touch(touch: Touch, radius_m: Array, meridian: Array, hoop: Array) -> Touch:
    """The touch on a sheet (`sheet_law`, `sheet_skin`) that conducts as much: of conductances (n,) along the meridian
    and around over that at rest, at radii (n,), m, increasing from 0. Stretches are the sheet's own, not the surface's.
    """
    turn = np.sqrt(np.sqrt(meridian / hoop))
    moved = {name: np.interp(radius_m, touch.radius_m, getattr(touch, name)) for name in (
        "u_r_m", "u_z_m", "pressure_Pa")}
    return replace(touch, radius_m=radius_m, stretch_meridian=1 / turn, stretch_hoop=turn,
                   stretch_normal=np.sqrt(meridian * hoop), **moved)
