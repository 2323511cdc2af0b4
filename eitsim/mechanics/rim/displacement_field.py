"""The foam's displacement about a punch near the rim, as kept on its touch: at places, and with its gradient."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem
from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.harmonics.arcs import AngularQuadrature, OffsetDisc, OffsetOutline, harmonics_at
from eitsim.mechanics.harmonics.clipped_disc import ClippedDisc, amplitudes
from eitsim.mechanics.harmonics.equilibrium import contact_state
from eitsim.mechanics.harmonics.fourier_fields import Points, gradients
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.grid import lagrange
from eitsim.scene.results import Volume
from matcal.laws.law import Law
from touchcal.arrays import Array

Indices = NDArray[np.int64]

# Angles on half a turn, and on a whole one, at which the contact pressure is kept.
_ANGLES, _WHOLE_TURN = 25, 97


@dataclass(frozen=True)
class Places:
    """Places in the undeformed foam about the punch's axis, and the elements that they belong to."""

    # (n,) radius and height, m
    radius_m: Array
    height_m: Array
    plane: Indices  # (n,) number of its half-plane
    angle_rad: Array  # (planes,) angles of these from the direction that the volume's angles count from, rad
    within_m: Array  # (n, 2) radius and height, m, of a place inside the element that each belongs to


def volume_of(disc: ClippedDisc, outline: OffsetDisc | OffsetOutline, model: IndentationProblem, state: Equilibrium,
              x: Array, law: Law, unit: float, axis_m: Array, bearing_rad: float) -> Volume:
    """What a touch keeps of a clipped disc's solution x; outside what it reaches, that of the axisymmetric state."""
    radius, height = model.grid.lines
    moved = np.zeros((len(model.grid.nodes), 3, len(disc.fixed)))
    moved[:, [0, 2], 0] = axisymmetric_assembly.nodal(model.grid, state.x[:-1])
    moved[:len(disc.base)] = disc.base + amplitudes(disc, x[:-1])
    middle = model.grid.nodes[disc.facing.nodes[:, [0, -1]], 0].mean(axis=1)
    share = np.linspace(0, 1, _WHOLE_TURN if outline.whole_turn else _ANGLES)
    ends = (outline.disc, outline.offset) if isinstance(outline, OffsetDisc) else (np.inf, 0.0)
    kept = Volume(
        radius_m=radius * unit, height_m=height * unit, order=disc.order,
        amplitude_m=moved.reshape(len(radius), len(height), *moved.shape[1:]) * unit, facet_m=middle * unit,
        share=share, pressure_Pa=np.zeros((len(middle), len(share))), disc_m=ends[0] * unit, offset_m=ends[1] * unit,
        punch_m=disc.punch.profile.radius * unit, bearing_rad=bearing_rad, law=law, axis_m=axis_m,
        whole_turn=outline.whole_turn)
    return replace(kept, pressure_Pa=_pressure(disc, x, kept, unit) * law.mu_0_Pa)


def _pressure(disc: ClippedDisc, x: Array, volume: Volume, unit: float) -> Array:
    """Contact pressure (facets, angles) on the deformed surface over mu_0, averages along the facets."""
    radius, share = disc.facing.radius[:, 0], volume.share
    start, turn = _circles(volume, radius[:, None] * unit)
    angle = start + turn * share
    circles = AngularQuadrature(np.ones_like(angle), *harmonics_at(angle, len(disc.fixed), volume.whole_turn),
                                volume.whole_turn)
    push = contact.pressure(disc.punch, contact_state(replace(
        disc, facing=replace(disc.facing, weight=circles.weight, circles=circles)), x).penetration)
    middle = np.repeat(volume.facet_m, contact.POINTS)
    within = np.column_stack([middle, np.full(len(middle), volume.height_m[-2])])
    there = Places(np.repeat(radius * unit, len(share)), np.zeros(angle.size), np.arange(angle.size), angle.ravel(),
                   np.repeat(within, len(share), axis=0))
    weight = radius * np.tile(np.polynomial.legendre.leggauss(contact.POINTS)[1], len(volume.facet_m))
    area = widening(gradient(volume, there)).reshape(angle.shape)
    return np.divide(*((weight[:, None] * part).reshape(-1, contact.POINTS, len(share)).sum(axis=1)
                       for part in (push, area)))


def _circles(volume: Volume, radius_m: Array) -> tuple[Array, Array]:
    """First angle of circles about the axis, and the turn from there that the places on them share, rad."""
    if volume.whole_turn:
        return np.zeros_like(radius_m), np.full_like(radius_m, 2 * np.pi)
    start = OffsetDisc(volume.disc_m, volume.offset_m).start(radius_m)
    return start, np.maximum(np.pi - start, np.finfo(float).tiny)


def widening(deformation: Array) -> Array:
    """Current over reference area (n,) of a horizontal surface at deformation gradients (n, 3, 3)."""
    return np.linalg.norm(np.cross(deformation[..., 0], deformation[..., 1]), axis=-1)


def gradient(volume: Volume, at: Places) -> Array:
    """Deformation gradients (n, 3, 3) in the local frame (r, theta, z); 1 outside the mesh."""
    _, slope, nodes = _shapes(volume, at)
    amplitude = volume.amplitude_m.reshape(-1, *volume.amplitude_m.shape[2:])
    angle = at.angle_rad[:, None]
    waves = AngularQuadrature(np.ones_like(angle), *harmonics_at(angle, amplitude.shape[2], volume.whole_turn),
                              volume.whole_turn)
    found = gradients(Points(slope, nodes, at.plane, waves), amplitude)[..., 0].reshape(-1, 3, 3)
    return np.eye(3) + np.where(_outside(volume, at)[:, None, None], 0.0, found)


def displacement(volume: Volume, at: Places) -> Array:
    """Displacements (n, 3), m, in the local frame (r, theta, z); none outside the mesh."""
    value, _, nodes = _shapes(volume, at)
    amplitude = volume.amplitude_m.reshape(-1, *volume.amplitude_m.shape[2:])
    parts = np.zeros((len(value), *amplitude.shape[1:]))
    for shape, node in zip(value.T, nodes.T, strict=True):
        parts += shape[:, None, None] * amplitude[node]
    cosine, sine = (table[at.plane, :, 0] for table in harmonics_at(at.angle_rad[:, None], amplitude.shape[2],
                                                                    volume.whole_turn))
    moved = np.sum(parts * np.stack([cosine, sine, cosine], axis=1), axis=2)
    return np.where(_outside(volume, at)[:, None], 0.0, moved)


def contact_pressure(volume: Volume, radius_m: Array, angle_rad: Array) -> Array:
    """Contact pressure (n,), Pa, on the deformed surface: linear between facets' middles and between angles."""
    start, turn = _circles(volume, radius_m)
    angle = angle_rad % (2 * np.pi)
    angle = angle if volume.whole_turn else np.minimum(angle, 2 * np.pi - angle)
    share = np.clip((angle - start) / turn, 0.0, 1.0)
    inside = np.clip(radius_m, volume.facet_m[0], volume.facet_m[-1])
    held = RegularGridInterpolator((volume.facet_m, volume.share), volume.pressure_Pa)(np.stack([inside, share], -1))
    return np.where(radius_m > volume.facet_m[-1], 0.0, held)


def _outside(volume: Volume, at: Places) -> NDArray[np.bool_]:
    return at.within_m[:, 0] > volume.radius_m[-1]


def _shapes(volume: Volume, at: Places) -> tuple[Array, Array, Indices]:
    """Shape functions (n, nodes), their N_,r, N_,z and N/r (n, nodes, 3), and the nodes' numbers. On the axis N_,r
    stands for N/r: what multiplies the N/r of its own nodes is zero for a smooth field."""
    value_r, slope_r, column = _along(volume.radius_m, volume.order, at.radius_m, at.within_m[:, 0])
    value_z, slope_z, row = _along(volume.height_m, volume.order, at.height_m, at.within_m[:, 1])
    axis = (at.radius_m == 0)[:, None]
    hoop = np.where(axis, slope_r, value_r / np.where(axis, 1.0, at.radius_m[:, None]))
    pairs = ((value_r, value_z), (slope_r, value_z), (value_r, slope_z), (hoop, value_z))
    value, *slope = ((r[:, :, None] * z[:, None]).reshape(len(r), -1) for r, z in pairs)
    return value, np.stack(slope, axis=-1), (column[:, :, None] * len(volume.height_m) + row[:, None]).reshape(
        len(column), -1)


def _along(lines: Array, order: int, at: Array, within: Array) -> tuple[Array, Array, Indices]:
    """Shape functions (n, order + 1) at places on a line of elements, those that `within` lies in, their slopes and
    nodes."""
    ends = lines[::order]
    left = order * np.clip(np.searchsorted(ends, within, side="right") - 1, 0, len(ends) - 2)
    first, last = lines[left], lines[left + order]
    value, slope = lagrange(order, (2 * at - first - last) / (last - first))
    return value, slope * (2 / (last - first))[:, None], left[:, None] + np.arange(order + 1)
