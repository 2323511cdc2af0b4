"""Stress, tangent and energy of a law at many points of a meridian, compiled.

In the meridian plane F = l_1 u_1 v_1' + l_2 u_2 v_2', and l_3 is the hoop stretch (1 in plane strain); the modes are
those of `eitsim.mechanics.solid.principal_stretches` for the pair (1, 2).
"""

import math
from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.solid.bonded_laws import by_part
from eitsim.mechanics.solid.principal_stretches import differentiate
from eitsim.mechanics.solid.volume_projection import VolumeProjection, split
from matcal.laws.compiled_response import energies, responses
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.jit import compiled

_NO_COUPLING = np.empty((0, 3))


@dataclass(frozen=True)
class Response:
    """What a law answers to the displacement gradients of points (...)."""

    stress: Array  # (..., 5) first Piola stress
    tangent: Array  # (..., 5, 5) its derivative by the point's own gradient, negative curvatures scaled
    by_volume: "ByVolume | None" = None  # with a projected change of volume


@dataclass(frozen=True)
class ByVolume:
    """What a projected change of volume does at points (...)."""

    volume: Array  # (..., 5) derivative of the point's own logarithm of volume by its gradient
    shape: Array  # (..., 5) derivative of the first Piola stress of shape by the projected logarithm of volume
    bulk: Array  # (...) that of the pressure


def response(law: Law, grad_u: Array, negative_curvature_scale: float = 1.0,
             projection: VolumeProjection | None = None) -> Response:
    """Stress and tangent at F = 1 + grad_u. grad_u (..., 5) has the parts rr, rz, zr, zz and hoop and must be
    admissible; it is (elements, points, 5) with a projection of the change of volume."""
    points = np.ascontiguousarray(grad_u).reshape(-1, 5)
    stress, tangent = np.empty(points.shape), np.empty((*points.shape, 5))
    x, mean, half = _stretches(points)
    shift = _shift(x, projection)
    force, block, slope = by_part(law, responses, x + shift, mean + shift, half)
    coupling, bulk = _NO_COUPLING, None
    if projection is not None:
        elements = projection.weight.shape
        coupling, bulk = split(force.reshape(*elements, 3), block.reshape(*elements, 3, 3), projection)
        coupling = coupling.reshape(-1, 3)
    volume, shape = np.empty((2, len(coupling), 5))
    _compose(points, x, mean, half, force, block, slope, negative_curvature_scale, coupling, stress, tangent, volume,
             shape)
    return Response(stress.reshape(grad_u.shape), tangent.reshape(*grad_u.shape, 5), None if bulk is None else ByVolume(
        volume.reshape(grad_u.shape), shape.reshape(grad_u.shape), bulk))


def _shift(x: Array, projection: VolumeProjection | None) -> Array | float:
    """(n, 1) what a projection of the change of volume adds to the stretches x (n, 3) of points."""
    if projection is None:
        return 0.0
    volume = x.sum(axis=1)
    return ((projection(volume.reshape(projection.weight.shape)).ravel() - volume) / 3)[:, None]


def energy_density(law: Law, grad_u: Array, projection: VolumeProjection | None = None) -> Array:
    """Energy per reference volume (...) at F = 1 + grad_u (..., 5), as `response`."""
    x, _, _ = _stretches(np.ascontiguousarray(grad_u).reshape(-1, 5))
    return by_part(law, energies, x + _shift(x, projection)).reshape(grad_u.shape[:-1])


def area_change(grad_u: Array) -> Array:
    """det F - 1 in the meridian plane at F = 1 + grad_u (..., 5)."""
    rr, rz, zr, zz = np.moveaxis(grad_u[..., :4], -1, 0)
    return rr + zz + rr * zz - rz * zr


def log_stretches(grad_u: Array) -> Array:
    """Logarithmic principal stretches (..., 3) of F = 1 + grad_u (..., 5): in-plane larger, smaller, hoop."""
    return _stretches(grad_u)[0]


def _stretches(grad_u: Array) -> tuple[Array, Array, Array]:
    """Logarithmic stretches (..., 3), and mean and half difference (..., 1) of those in the plane."""
    rr, rz, zr, zz, hoop = np.moveaxis(grad_u, -1, 0)
    mean = np.log1p(area_change(grad_u)) / 2
    half = np.arctanh(np.hypot(rr - zz, rz + zr) / np.hypot(2 + rr + zz, rz - zr))
    return np.stack([mean + half, mean - half, np.log1p(hoop)], axis=-1), mean[..., None], half[..., None]


@compiled
def _compose(grad_u, x, mean, half, forces, blocks, slope, scale, coupling, stress, tangent, volume, shape):
    modes, rest, work, root = np.empty((4, 4)), np.empty(2), np.empty((3, 3, 3)), math.sqrt(0.5)
    for p in range(grad_u.shape[0]):
        rr, rz, zr, zz, _ = grad_u[p]
        turned, stretched = math.hypot(2 + rr + zz, zr - rz), math.hypot(rr - zz, rz + zr)
        force, block = forces[p], blocks[p]
        differentiate(x[p], mean[p], half[p], slope[p], scale, force, block, rest, work)
        cd, sd = ((2 + rr + zz) / turned, (zr - rz) / turned) if turned > 0 else (1.0, 0.0)
        cs, ss = ((rr - zz) / stretched, (rz + zr) / stretched) if stretched > 0 else (1.0, 0.0)
        modes[0, 0], modes[0, 1], modes[0, 2], modes[0, 3] = (cd + cs) / 2, (ss - sd) / 2, (ss + sd) / 2, (cd - cs) / 2
        modes[1, 0], modes[1, 1], modes[1, 2], modes[1, 3] = (cd - cs) / 2, (-ss - sd) / 2, (sd - ss) / 2, (cd + cs) / 2
        modes[2, 0], modes[2, 1], modes[2, 2], modes[2, 3] = -ss * root, cs * root, cs * root, ss * root
        modes[3, 0], modes[3, 1], modes[3, 2], modes[3, 3] = sd * root, cd * root, -cd * root, sd * root
        for i in range(4):
            stress[p, i] = force[0] * modes[0, i] + force[1] * modes[1, i]
            across = block[2, 0] * modes[0, i] + block[2, 1] * modes[1, i]
            tangent[p, 4, i], tangent[p, i, 4] = across, across
            first = block[0, 0] * modes[0, i] + block[0, 1] * modes[1, i]
            second = block[1, 0] * modes[0, i] + block[1, 1] * modes[1, i]
            for j in range(4):
                tangent[p, i, j] = (first * modes[0, j] + second * modes[1, j] + rest[0] * modes[2, i] * modes[2, j]
                                    + rest[1] * modes[3, i] * modes[3, j])
        stress[p, 4] = force[2]
        tangent[p, 4, 4] = block[2, 2]
        if len(coupling):
            first, second, hoop = math.exp(-x[p, 0]), math.exp(-x[p, 1]), math.exp(-x[p, 2])
            for i in range(4):
                volume[p, i] = first * modes[0, i] + second * modes[1, i]
                shape[p, i] = coupling[p, 0] * first * modes[0, i] + coupling[p, 1] * second * modes[1, i]
            volume[p, 4], shape[p, 4] = hoop, coupling[p, 2] * hoop
