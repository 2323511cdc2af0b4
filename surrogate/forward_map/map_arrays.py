"""The learned forward map as arrays: many touches at once, of electrodes a little elsewhere, by NumPy or torch.

A reading is a bilinear form in the fields of the electrodes that drive and read (`multipole_series`, `polarization`):
a touch is one symmetric matrix M of electrodes by electrodes, and its readings are sums of four of its entries. A
turned electrode turns its field; what it changes of the fields of the others is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import electrode_correction, multipole_series, polarization, rim_correction, rim_zone
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.multipole_series import ORDERS
from surrogate.statistics import change_point
from touchcal.arrays import Array, Index

Values = Any  # an array of NumPy or a tensor of torch
LEAST = 1e-12  # squared radius, over that of the disc, below which a place has no direction
# Arrays of processes, sums of large terms of both signs, which stay in double precision where all else is in single.
PROCESSES = ("centre", "scale", "nodes", "weights", "trend", "lengths")
CLOSE = 1e-9  # part of a field's series that is left out at the outermost place


@dataclass(frozen=True, eq=False)
class MetalArrays:
    """What electrodes add near the rim: `electrode_correction.RimEffect`."""

    turn: Values  # (maps, 2) cosine and sine of the turns of the symmetries
    mirrored: Values  # (maps,) -1 where the place is mirrored first, else 1
    directions: Values  # (maps, readings, components)
    nodes: Values  # (k, 6) over the lengths
    lengths: Values  # (6,)
    weights: Values  # (k, components)
    whole: Values  # (4, readings of the whole ring) entries of M


@dataclass(frozen=True, eq=False)
class RimArrays:
    """What was learned of the rim of a disc: `rim_correction.FittedCorrection`."""

    nodes: Values  # (k, 4) of the polarization
    centre: Values  # (4,)
    lengths: Values  # (4,)
    weights: Values  # (5 + k, coefficients)
    places: Values  # (coefficients, 4 orders^2)
    replaces: bool
    step: float
    metal: MetalArrays | None


@dataclass(frozen=True, eq=False)
class MapArrays:
    """All that the map is made of; `converted` makes tensors of it."""

    radius_mm: float
    p0: float  # N/mm^2, of the load g = asinh(F / (d^2 p0))
    interior: float
    high_end: tuple[float, float]  # zones, see `rim_zone.Zones`
    learned: tuple[float, float]
    angle_rad: Values  # (electrodes,)
    series: Values  # (modes, orders) coefficients of the derivatives of an electrode's field
    entries: Values  # (4, readings) entries of M that a reading adds, adds, takes off and takes off
    size_centre: Values  # (inputs,) of the size of the strengths
    size_slope: Values  # (1 + inputs,)
    size_curvature: Values  # (2, 2)
    # Gaussian processes of the strengths over the size
    centre: Values  # (inputs,)
    scale: Values  # (orders, 1, inputs) reciprocal lengths
    nodes: Values  # (orders, inputs, k)
    weights: Values  # (orders, k, 1)
    trend: Values  # (1 + inputs, orders)
    rim: RimArrays | None

    @property
    def materials(self) -> int:
        """States of the material."""
        return len(self.size_centre) - 3


def map_arrays(forward: ForwardMap, reach: float | None = None) -> MapArrays:
    """The arrays of a map of a disc; reach: the largest distance of touches from its centre, over the radius, that
    they are for, that of the training where left out. ValueError for a skin with an outline."""
    ring, size, together, zones = forward.ring, forward.size, forward.together, forward.zones
    if ring.sheet is not None or ring.curved is not None:
        raise ValueError("frames are drawn from maps of discs, and this model is of a skin with an outline. Simulate "
                         "it by `eitsim sweep`.")
    reach = float(forward.bounds[1, 0]) / ring.radius_mm if reach is None else reach
    rim = _rim(forward) if rim_correction.teaches(forward.correction) else None
    orders = ORDERS if rim is None else max(ORDERS, polarization.orders_of(rim.weights.shape[1]))
    modes = min(len(forward.field), orders + math.ceil(math.log(CLOSE) / math.log(min(max(reach, 0.05), 0.98))))
    known = len(size.centre)
    return MapArrays(
        ring.radius_mm, forward.p0, forward.interior, zones.high_end, zones.learned, ring.angle_rad,
        multipole_series.coefficients_of(forward.field, orders)[:modes], _entries(ring), size.centre,
        size.weights[:1 + known], size.curvature, together.processes[0].centre, together.scale,
        np.stack([one.nodes.T for one in together.processes]), together.moments[..., :1], together.trend, rim)


def _entries(ring: Ring) -> Index:
    count = len(ring.angle_rad)
    return np.stack([ring.source * count + ring.read, ring.sink * count + ring.ground,
                     ring.source * count + ring.ground, ring.sink * count + ring.read])


def _rim(forward: ForwardMap) -> RimArrays:
    fitted = forward.correction
    answer, metal = fitted.polarization, fitted.rim
    arrays = None
    if electrode_correction.teaches(metal):
        symmetry = metal.symmetry
        arrays = MetalArrays(np.column_stack([symmetry.turn.real, symmetry.turn.imag]),
                             np.where(symmetry.mirrored, -1.0, 1.0), metal.directions, metal.process.nodes,
                             metal.process.lengths, metal.process.weights, _entries(metal.whole))
    return RimArrays(answer.nodes, answer.centre, answer.lengths, answer.weights,
                     polarization.places(polarization.orders_of(answer.weights.shape[1])), fitted.replaces, fitted.step,
                     arrays)


def converted(part: Any, convert: Callable[[str, Array], Values]) -> Any:
    """The same with `convert` of the name and the values of every array."""
    made = {}
    for one in fields(part):
        value = getattr(part, one.name)
        if isinstance(value, np.ndarray):
            made[one.name] = convert(one.name, value)
        elif is_dataclass(value):
            made[one.name] = converted(value, convert)
    return replace(part, **made)


def signals(arrays: MapArrays, xp: Any, touch: Values, turned: Values | None = None,
            material: Values | None = None) -> Values:
    """(n, readings) change of the readings, V, by touches (n, 4) in mm and N.

    arrays: of the library and the precision of the touches; xp: that library, numpy or torch; turned: (n, electrodes)
    angles by which electrodes lie off their places, rad; material: (n, k) standard normal states, 0 where left out.
    """
    x, y, log_d = touch[:, 0] / arrays.radius_mm, touch[:, 1] / arrays.radius_mm, xp.log(touch[:, 2])
    load = xp.arcsinh(touch[:, 3] / (touch[:, 2] ** 2 * arrays.p0))
    radial = xp.sqrt(x**2 + y**2 + LEAST)
    size, strength = _strengths(arrays, xp, touch[:, 3], log_d, load, radial, material)
    real, imaginary = _fields(arrays, xp, x, y, turned)
    rim = arrays.rim
    part = _parts(arrays, xp, radial, rim is not None and rim.replaces)
    weight = (part * strength)[:, None]
    table = (real[..., :ORDERS] * weight) @ real[..., :ORDERS].swapaxes(1, 2)
    table = table + (imaginary[..., :ORDERS] * weight) @ imaginary[..., :ORDERS].swapaxes(1, 2)
    signal = readings_of(table, arrays.entries)
    if rim is None:
        return signal
    near = xp.where(radial > arrays.learned[0])[0]
    if not len(near):
        return signal
    x, y, log_d, load, radial, real, imaginary = (one[near] for one in (x, y, log_d, load, radial, real, imaginary))
    added = _rim_signals(rim, xp, arrays, x, y, log_d, load, radial, real, imaginary)
    signal[near] = signal[near] + added * (_share(xp, radial, arrays.learned) * size[near])[:, None]
    return signal


def _strengths(arrays: MapArrays, xp: Any, force: Values, log_d: Values, load: Values, radial: Values,
               material: Values | None) -> tuple[Values, Values]:
    """Sizes (n,) and strengths (n, orders), V."""
    near = xp.where(radial < arrays.interior, radial, arrays.interior + 0 * radial)
    held = near[:, None] * arrays.size_centre[3:] * 0 if material is None else material
    x = xp.concatenate([xp.stack([log_d, load, near**2], 1), held], 1)
    u = x - arrays.size_centre
    log_size = arrays.size_slope[0] + u @ arrays.size_slope[1:]
    log_size = log_size + 0.5 * ((u[:, :2] @ arrays.size_curvature) * u[:, :2]).sum(1)
    off = x - arrays.centre
    kernel = xp.exp(-0.5 * _squared(off * arrays.scale, arrays.nodes))
    over = _as(x, (kernel @ arrays.weights)[..., 0].swapaxes(0, 1) + arrays.trend[0] + off @ arrays.trend[1:])
    size = xp.exp(log_size) * force
    return size, over * size[:, None]


def _as(like: Values, values: Values) -> Values:
    """Values in the precision of others."""
    return values.astype(like.dtype) if isinstance(values, np.ndarray) else values.to(like.dtype)


def _squared(u: Values, nodes: Values) -> Values:
    """(..., n, k) squared distances of u (..., n, q) to nodes (..., q, k)."""
    found = (u[..., 0, None] - nodes[..., 0, None, :]) ** 2
    for q in range(1, u.shape[-1]):
        found = found + (u[..., q, None] - nodes[..., q, None, :]) ** 2
    return found


def _fields(arrays: MapArrays, xp: Any, x: Values, y: Values, turned: Values | None) -> tuple[Values, Values]:
    """Real and imaginary parts (n, electrodes, orders) of the derivatives of the electrodes' fields."""
    angle = arrays.angle_rad + 0 * x[:, None] if turned is None else arrays.angle_rad + turned
    cosine, sine = xp.cos(angle), xp.sin(angle)
    modes, orders = arrays.series.shape
    x, y = x[:, None], y[:, None]
    real, imaginary = _powers(xp, x * cosine + y * sine, y * cosine - x * sine, modes)
    real, imaginary = real @ arrays.series, imaginary @ arrays.series
    by_real, by_imaginary = _powers(xp, cosine, -sine, orders + 1)
    by_real, by_imaginary = by_real[..., 1:], by_imaginary[..., 1:]
    return real * by_real - imaginary * by_imaginary, real * by_imaginary + imaginary * by_real


def _powers(xp: Any, real: Values, imaginary: Values, count: int) -> tuple[Values, Values]:
    """Parts (..., count) of the powers 0, 1, ... of complex numbers, by doubling."""
    u, v = (xp.stack([one, part], -1) for one, part in ((1 + 0 * real, real), (0 * imaginary, imaginary)))
    while (known := u.shape[-1]) < count:
        a, b = u[..., -1:], v[..., -1:]  # the highest power; times it all but the first are the next ones
        more_u, more_v = a * u[..., 1:] - b * v[..., 1:], a * v[..., 1:] + b * u[..., 1:]
        u, v = xp.concatenate([u, more_u], -1), xp.concatenate([v, more_v], -1)
        assert u.shape[-1] == 2 * known - 1
    return u[..., :count], v[..., :count]


def _parts(arrays: MapArrays, xp: Any, radial: Values, replaced: bool) -> Values:
    """(n, orders) how much of each order of the series counts."""
    high = 1 - _share(xp, radial, arrays.high_end)
    low = 1 - _share(xp, radial, arrays.learned) if replaced else 1 + 0 * radial
    return xp.stack([low if n < rim_zone.ORDERS else low * high for n in range(ORDERS)], 1)


def _share(xp: Any, radial: Values, zone: tuple[float, float]) -> Values:
    t = xp.clip((radial - zone[0]) / (zone[1] - zone[0]), 0.0, 1.0)
    return t**2 * (3 - 2 * t)


def readings_of(table: Values, entries: Values) -> Values:
    """(n, readings) sums of four entries each of tables (n, electrodes, electrodes)."""
    flat = table.reshape(len(table), -1)
    return flat[:, entries[0]] + flat[:, entries[1]] - flat[:, entries[2]] - flat[:, entries[3]]


def _rim_signals(rim: RimArrays, xp: Any, arrays: MapArrays, x: Values, y: Values, log_d: Values, load: Values,
                 radial: Values, real: Values, imaginary: Values) -> Values:
    """(n, readings) what is added near the rim, over the size of the strengths."""
    half = xp.exp(log_d) / 2 / arrays.radius_mm
    gap = 1 - radial - half
    side = change_point.side(gap, rim.step) if xp is np else (gap < rim.step).to(gap.dtype)
    inputs = xp.stack([log_d, load, _felt(xp, gap), side], 1)
    u = (inputs - rim.centre) / rim.lengths
    weights, trends = rim.weights, 1 + u.shape[1]
    signal = 0.0
    if len(rim.nodes):
        kernel = xp.exp(-0.5 * _squared(u, rim.nodes.swapaxes(0, 1)))
        mean = weights[0] + u @ weights[1:trends] + kernel @ weights[trends:]
        size = math.isqrt(rim.places.shape[1])
        form = ((_as(half, mean) / half[:, None] ** 2) @ rim.places).reshape(len(mean), size, size)
        by_real, by_imaginary = _powers(xp, x / radial * half, y / radial * half, size // 2 + 1)
        factorial = [math.factorial(k) for k in range(1, size // 2 + 1)]
        parts: list[Values] = [[], []]  # imaginary, then real ones
        for k, over in enumerate(factorial):
            a, b = by_real[:, k + 1, None] / over, by_imaginary[:, k + 1, None] / over
            parts[0].append(real[..., k] * b + imaginary[..., k] * a)
            parts[1].append(real[..., k] * a - imaginary[..., k] * b)
        series = xp.stack([*parts[0], *parts[1]], -1)
        signal = readings_of((series @ form) @ series.swapaxes(1, 2), arrays.entries)
    return signal if rim.metal is None else signal + _metal(rim.metal, xp, x, y, inputs, half, real, imaginary)


def _felt(xp: Any, gap: Values) -> Values:
    return xp.log(polarization.SOFT + xp.clip(gap, 0.0, None))


def _metal(metal: MetalArrays, xp: Any, x: Values, y: Values, inputs: Values, half: Values, real: Values,
           imaginary: Values) -> Values:
    u, v = x[:, None], y[:, None] * metal.mirrored
    images = u * metal.turn[:, 0] - v * metal.turn[:, 1], u * metal.turn[:, 1] + v * metal.turn[:, 0]
    angles = xp.arctan2(images[1], images[0])
    chosen = xp.where(angles < -1e-12, angles + 2 * math.pi, angles).argmin(1)
    rows = xp.arange(len(x)) if xp is np else xp.arange(len(x), device=x.device)
    u, v = images[0][rows, chosen], images[1][rows, chosen]
    radius = xp.sqrt(u**2 + v**2)
    felt = _felt(xp, 1 - radius - half)
    known = xp.stack([inputs[:, 0], inputs[:, 1], xp.log(electrode_correction.SOFT - radius),
                      electrode_correction.ALONG * xp.arctan2(v, u) * radius, felt, inputs[:, 3]], 1)
    away = xp.sqrt(5 * _squared(known / metal.lengths, metal.nodes.swapaxes(0, 1)) + LEAST**2)
    mean = _as(half, ((1 + away + away**2 / 3) * xp.exp(-away)) @ metal.weights)
    dipole = real[..., :1] * real[..., :1].swapaxes(1, 2) + imaginary[..., :1] * imaginary[..., :1].swapaxes(1, 2)
    mean = mean * xp.sqrt((readings_of(dipole, metal.whole) ** 2).sum(1))[:, None]
    signal = mean @ metal.directions[0].swapaxes(0, 1) * 0
    for k in range(len(metal.directions)):
        some = xp.where(chosen == k)[0]
        if len(some):
            signal[some] = mean[some] @ metal.directions[k].swapaxes(0, 1)
    return signal
