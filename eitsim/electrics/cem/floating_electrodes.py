"""Conducting punches as floating electrodes: where they touch the skin, and the network that joins them to it.

A punch at the potential U takes the current g (u - U) per area of the skin from a potential u, and lets none out:
int g (u - U) = 0 over its contact. The contact impedance z is that of the surface as it is, so that
g = sqrt(det C_s) / z on the reference disc, C_s the in-plane metric. The punch is one unknown more of the complete
electrode model; nothing that electrodes read changes.
Source: Somersalo, Cheney, Isaacson, doi:10.1137/0152060, with no current through the electrode.
"""

from collections.abc import Sequence

import numpy as np

from eitsim.electrics.cem.assembly import Array, Floating, SkinMesh, area_points, joined_over_areas
from eitsim.scene.results import Touch
from eitsim.scene.scene import Punch
from eitsim.sheet.sheet_conductance import added_metric, areal_stretch

Touches = Sequence[tuple[Punch, Touch]]


def shunt(punch: Punch, touch: Touch, radius_m: Array, areal: Array) -> Array:
    """Conductance to the punch per reference area, S/m^2, at radii where the surface is stretched to `areal` times its
    area: areal / z where the punch conducts and presses, inside the end of its contact, else 0."""
    if not punch.conductor:
        return np.zeros_like(radius_m)
    pressed = np.interp(radius_m, touch.radius_m, touch.pressure_Pa) > 0
    return np.where(pressed & (radius_m <= touch.contact_radius_m), areal / punch.contact_impedance_Ohm_m2, 0.0)


def shunt_ends(punch: Punch, touch: Touch) -> list[float]:
    """Radii, m, where `shunt` begins or ends, the outermost first; none for an insulated punch."""
    if not punch.conductor:
        return []
    held = np.append(touch.pressure_Pa, 0.0) > 0
    stops = np.append(touch.radius_m, np.inf)
    last, first = np.flatnonzero(held[:-1] & ~held[1:]), np.flatnonzero(~held[:-1] & held[1:])
    ends = {min(float(stops[i + 1]), touch.contact_radius_m) for i in last}
    begins = {float(stops[i]) for i in first if stops[i] < touch.contact_radius_m}
    return sorted(ends | begins, reverse=True)


def shunts(points_m: Array, touches: Touches) -> Array:
    """Conductance (conductors, ...) to each conducting punch per reference area, S/m^2, at points (..., 2)."""
    conducting = [(punch, touch) for punch, touch in touches if punch.conductor]
    out = np.zeros((len(conducting), *points_m.shape[:-1]))
    for k, (punch, touch) in enumerate(conducting):
        radius = _seen_radius(touch, points_m - np.array([punch.x_m, punch.y_m]))
        near = shunt(punch, touch, radius, np.ones_like(radius)) > 0
        areal = areal_stretch(added_metric(points_m[near], touches)[0])
        out[k, near] = shunt(punch, touch, radius[near], areal)
    return out


def _seen_radius(touch: Touch, away_m: Array) -> Array:
    """Radii (...), m, of places (..., 2) about a punch's axis, where its contact is not round scaled so that it ends at
    the largest in all directions."""
    radius = np.hypot(away_m[..., 0], away_m[..., 1])
    if (ends := touch.contact_ends_m) is None:
        return radius
    angle = 2 * np.pi * np.arange(len(ends)) / len(ends)
    end = np.interp(np.arctan2(away_m[..., 1], away_m[..., 0]), angle, ends, period=2 * np.pi)
    return radius * ends.max() / end


def floating(mesh: SkinMesh, touches: Touches) -> Floating | None:
    """The conducting punches on a mesh, numbered as they come among the touches; None where none conducts.

    ValueError where a contact holds no point of the mesh's quadrature.
    """
    if not any(punch.conductor for punch, _ in touches):
        return None
    conductance = shunts(area_points(mesh), touches)
    if missed := [k for k, own in enumerate(conductance) if not own.any()]:
        raise ValueError(f"the contact of conducting punch {missed[0]} (from 0) lies between the points of the skin's "
                         "mesh; give a larger force or a mesh that follows it.")
    conductor, cell = np.nonzero(conductance.any(axis=-1))
    return Floating(mesh.cells[cell], conductor, joined_over_areas(mesh, cell, conductance[conductor, cell]),
                    len(conductance))
