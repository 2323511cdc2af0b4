"""Touches that edges change: every circular harmonic scatters into others.

In polar coordinates t = ln r, angle about the punch the potential is a sum of cosines and sines of the angle; its power
int S_rr u_t^2 + 2 S_rh u_t u_h + S_hh u_h^2 dt dh is that of quadratic elements in t. Rings of elements are joined from
the punch outwards, and what is left is the admittance at the outermost circle. Where a touch is symmetric about a line,
cosines of the angle from it do not mix with sines, and half of every ring is enough.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from eitsim.electrics.cem.floating_electrodes import shunt_ends, shunts
from eitsim.electrics.cem.ring_scattering import Array, Indices, ring_share
from eitsim.scene.results import Touch
from eitsim.scene.scene import Punch, Skin
from eitsim.sheet import sheet_conductance as sheet
from matcal.laws.conductivity import Conductivity
from touchcal.jit import compiled

# Angles at which half a ring is sampled: exact for products of two harmonics and a change of conductance up to the
# harmonic twice this less both.
_ANGLES = 24
_SAME = 1e-6  # Radii closer than this share of the outermost one are one.
_GAUSS = np.array([-1.0, 1.0]) / np.sqrt(3.0)
# Values and slopes (point, node) on an element from -1 to 1 of the functions of its inner end, middle and outer end.
_VALUE = np.stack([_GAUSS * (_GAUSS - 1) / 2, 1 - _GAUSS**2, _GAUSS * (_GAUSS + 1) / 2], axis=1)
_SLOPE = np.stack([_GAUSS - 0.5, -2 * _GAUSS, _GAUSS + 0.5], axis=1)


@dataclass(frozen=True, eq=False)
class _Waves:
    """Functions of the angle that scatter into each other: cosines, and sines with a minus, of its multiples."""

    order: Indices  # (n,) the multiples; 0, the constant, comes first where it belongs to them
    value: Array  # (n, angles)
    slope: Array  # (n, angles) derivatives by the angle


def coupled_scattering(punch: Punch, touch: Touch, skin: Skin, law: Conductivity, reach_m: float,
                       orders: int) -> Array:
    """Scattering (2 orders, 2 orders) of harmonics 1 to `orders` about a punch, by real and then imaginary parts of
    amplitudes: Re b_m (zeta/reach)^m comes in, Re conj(c_m) (zeta/reach)^-m goes out, c = T b.

    Elements end at the samples of the touch and of what edges change; to cut each in four changes T by 2e-5 or less
    of its largest entry.
    """
    radii = _radii(punch, touch, reach_m)
    log = np.log(radii)
    step = np.diff(log)
    place = np.exp(log[:-1, None] + step[:, None] * (1 + _GAUSS) / 2)
    angle, families = _waves(touch, orders)
    along, mixed, across, to_punch = _polar(punch, touch, skin, law, reach_m, place, angle)
    free = sheet.untouched_conductance(law, skin)
    core, held = float(np.sqrt(along[0, 0] * across[0, 0]).mean()), float(to_punch[0, 0].mean()) * radii[0]**2
    scattered = []
    for waves in families:
        value, slope, order = waves.value, waves.slope, waves.order
        power, current = [_products(value, along, value), _products(value, mixed, slope),
                          _products(slope, across, slope)], None
        if punch.conductor:
            shunted = to_punch * place[..., None] ** 2
            power[2] = power[2] + _products(value, shunted, value)
            current = shunted @ value.T * (2 / len(angle)) if order[0] == 0 else None
        inside = np.where(order > 0, np.sqrt(core * (core * order**2 + held / 4)), 0.0)
        known = order > 0
        y = _joined(_elements(step, power, current), inside, held)[np.ix_(known, known)]
        outside = np.diag(free * order[known])
        scattered.append(np.linalg.solve(outside + y, outside - y))
    bearing = float(np.angle(sheet.local_axes(punch, touch)[0] @ [1, 1j]))
    return _turned(np.asarray(block_diag(*scattered), dtype=float), np.arange(1, orders + 1), bearing)


def _waves(touch: Touch, orders: int) -> tuple[Array, list[_Waves]]:
    """Angles from the line of symmetry, or the first axis, at which rings are sampled, rad, and the families of
    functions that do not scatter into each other."""
    whole = touch.rim is not None and touch.rim.whole_turn
    angle = np.pi * (np.arange(_ANGLES * (1 + whole)) + 0.5) / _ANGLES
    even, odd, none = np.arange(orders + 1), np.arange(1, orders + 1), np.arange(0)
    return angle, [_of(even, odd, angle)] if whole else [_of(even, none, angle), _of(none, odd, angle)]


def _of(even: Indices, odd: Indices, angle: Array) -> _Waves:
    """Cosines of the multiples `even` of angles, and sines with a minus of the multiples `odd`."""
    order = np.concatenate([even, odd])
    turn, other = np.multiply.outer(even, angle), np.multiply.outer(odd, angle)
    value, by_order = np.concatenate([np.cos(turn), -np.sin(other)]), -np.concatenate([np.sin(turn), np.cos(other)])
    return _Waves(order, value, order[:, None].astype(float) * by_order)


def _radii(punch: Punch, touch: Touch, reach_m: float) -> Array:
    """Radii (n + 1,) > 0, m, of the ends of elements."""
    changed = touch.rim.radius_m if touch.rim is not None else np.empty(0)
    stops = np.concatenate([touch.radius_m, changed, shunt_ends(punch, touch), [touch.contact_radius_m]])
    stops = np.unique(np.append(stops[(stops > 0) & (stops < reach_m)], reach_m))
    return stops[np.append(True, np.diff(stops) > _SAME * reach_m)]


def _polar(punch: Punch, touch: Touch, skin: Skin, law: Conductivity, reach_m: float, radius_m: Array,
           angle: Array) -> tuple[Array, Array, Array, Array]:
    """Conductances rr, rh and hh, S, with `ring_share` of the change, and to the punch, S/m^2, (..., angles) at radii
    (...), m, and angles from the first axis, rad."""
    axes = sheet.local_axes(punch, touch)
    radial = np.stack([np.cos(angle), np.sin(angle)], axis=-1) @ axes
    hoop = np.stack([-np.sin(angle), np.cos(angle)], axis=-1) @ axes
    points = np.array([punch.x_m, punch.y_m]) + radius_m[..., None, None] * radial
    found = sheet.sheet_conductance(points, punch, touch, skin, law)
    free, share = sheet.untouched_conductance(law, skin), ring_share(radius_m, reach_m)[..., None]
    xx, xy, yy = found[..., 0, 0], found[..., 0, 1], found[..., 1, 1]
    rr, rh, hh = (one[:, 0] * other[:, 0] * xx + (one[:, 0] * other[:, 1] + one[:, 1] * other[:, 0]) * xy
                  + one[:, 1] * other[:, 1] * yy for one, other in ((radial, radial), (radial, hoop), (hoop, hoop)))
    to_punch = shunts(points, ((punch, touch),))[0] if punch.conductor else np.zeros_like(rr)
    return free + share * (rr - free), share * rh, free + share * (hh - free), to_punch


def _elements(step: Array, power: list[Array], to_punch: Array | None) -> Array:
    """Admittances (e, 3 n [+ 1], the same) of elements between harmonics at their inner end, in their middle, at their
    outer end and, where the sheet is joined to it, the punch. Power (e, q, n, n) of slopes, of slopes and values, and
    of values, and what flows from these (e, q, n) to the punch, both per step."""
    slope, value = 2 * _SLOPE, _VALUE
    length = step[:, None, None, None]
    count = power[0].shape[-1]
    terms = np.concatenate([part.swapaxes(0, 1) for part in (
        power[0] / length, power[1], power[1].swapaxes(-1, -2), power[2] * length)])
    nodal = np.concatenate([(one[:, :, None] * other[:, None] / 2).reshape(len(one), -1) for one, other in (
        (slope, slope), (slope, value), (value, slope), (value, value))])
    parts = (nodal.T @ terms.reshape(len(nodal), -1)).reshape(3, 3, len(step), count, count)
    whole = parts.transpose(2, 0, 3, 1, 4).reshape(len(step), 3 * count, 3 * count)
    if to_punch is None:
        return whole
    flow = np.einsum("qa,eqm->eam", value, to_punch * step[:, None, None] / 2).reshape(len(step), -1)
    joined = np.concatenate([whole, -flow[:, :, None]], axis=2)
    own = np.append(-flow, flow[:, ::count].sum(axis=1, keepdims=True), axis=1)
    return np.concatenate([joined, own[:, None]], axis=1)


def _products(one: Array, conductance: Array, other: Array) -> Array:
    """(..., n, n) of functions (n, angles) by a conductance (..., angles): 1/pi times the integral around."""
    count, angles = one.shape
    pairs = (one[:, None] * other * (2 / angles)).reshape(count**2, angles)
    return (conductance @ pairs.T).reshape(*conductance.shape[:-1], count, count)


def _joined(elements: Array, core: Array, held: float) -> Array:
    """Admittance (n, n) at the outer end of elements joined at their ends, that of the core (n,) at the inner one, of
    which the first harmonic is joined to the punch, where there is one, by an admittance."""
    count = len(core)
    inner = np.zeros((elements.shape[-1] - 2 * count,) * 2)
    inner[:count, :count] = np.diag(core)
    if len(inner) > count:
        inner[np.ix_([0, -1], [0, -1])] += held * np.array([[1.0, -1.0], [-1.0, 1.0]])
    _outwards(elements, count, inner)
    return inner[:count, :count] - inner[:count, count:] @ inner[count:, :count] / inner[-1:, -1:] if len(
        inner) > count else inner


@compiled
def _outwards(elements, count, known):
    """Admittances, those that are known at the inner end of the first element becoming those at the outer end of the
    last: what the ends and middles inside have is eliminated, two at a time, in upper triangles."""
    size, kept = elements.shape[-1], len(known)
    front = np.empty((size, size))
    for element in elements:
        for i in range(size):  # one number at a time: copying slices compiles what words the message of unequal shapes
            for j in range(size):
                front[i, j] = element[i, j]
        for i in range(kept):
            for j in range(kept):
                front[i if i < count else i + 2 * count, j if j < count else j + 2 * count] += known[i, j]
        for k in range(0, 2 * count, 2):
            one, other = front[k], front[k + 1]
            share = one[k + 1] / one[k]
            for j in range(k + 1, size):
                other[j] -= share * one[j]
            by_one, by_other = 1 / one[k], 1 / other[k + 1]
            for i in range(k + 2, size):
                p, q, row = one[i] * by_one, other[i] * by_other, front[i]
                for j in range(i, size):
                    row[j] -= p * one[j] + q * other[j]
        for i in range(kept):
            for j in range(i, kept):
                known[i, j] = known[j, i] = front[2 * count + i, 2 * count + j]


def _turned(matrix: Array, m: Indices, angle: float) -> Array:
    """Scattering by real and imaginary parts of amplitudes of harmonics of the angle, of that of the angle from a line
    in a direction, rad."""
    cosine, sine = np.diag(np.cos(m * angle)), np.diag(np.sin(m * angle))
    to_line = np.block([[cosine, -sine], [sine, cosine]])
    return to_line.T @ matrix @ to_line
