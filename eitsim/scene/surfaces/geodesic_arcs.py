"""Circular arcs from one place: the sphere's exponential map, and its like with another curvature each way."""

import numpy as np

from touchcal.arrays import Array


def arcs(uv: Array, form: Array) -> tuple[Array, Array]:
    """Points and unit normals (..., 3), along two tangents and the outward normal at the origin, at the ends of arcs of
    length |uv| (...) towards uv (..., 2), of the curvatures k = d' form d of a form (2, 2), 1/m, positive where they
    bend inwards: a sphere's exact ones where form = 1/R."""
    length = np.linalg.norm(uv, axis=-1, keepdims=True)
    bend = np.sum(uv * (uv @ form), axis=-1, keepdims=True) / np.where(length > 0, length, 1.0)  # k |uv|
    along = uv * np.sinc(bend / np.pi)
    down = bend * length * np.sinc(bend / (2 * np.pi)) ** 2 / 2
    way = uv / np.where(length > 0, length, 1.0)
    return np.concatenate([along, -down], axis=-1), np.concatenate([np.sin(bend) * way, np.cos(bend)], axis=-1)
