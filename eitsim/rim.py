"""The untouched skin without a mesh: harmonic series inside the disc, an integral equation for its line electrodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from numpy.typing import NDArray

from eitsim.electrodes import arcs
from eitsim.scene import Body, Electrodes

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Gauss points in a panel, panels from the middle of an electrode to its end, and the ratio of neighbours' lengths;
# points of the rule that integrates the logarithm on a panel, and the power that smooths it.
_POINTS, _PANELS, _RATIO = 10, 9, 0.25
_LOG_POINTS, _LOG_POWER = 32, 6
# Harmonics around the rim.
HARMONICS = 192


@dataclass(frozen=True, eq=False)
class Rim:
    """A homogeneous disc with N line electrodes. Fields are Re sum_{n>0} a_n (r/R)^n exp(i n theta), theta from the
    middle of the first electrode."""

    # (N, N) impedance, Ohm; rows and columns sum to zero
    impedance_Ohm: Array
    # (h,) a_n, V, of 1 A into the first electrode and 1/N A out of every one
    driven: Array
    # (h, h) twice: rim potential Re sum g_n exp(i n theta) of an inner source on a rim without electrodes -> the field
    # same @ g + crossed @ conj(g) that the floating electrodes add
    same: Array
    crossed: Array


@lru_cache(maxsize=64)
def solve_rim(body: Body, electrodes: Electrodes, conductance_S: float) -> Rim:
    """Solve the complete electrode model of a homogeneous disc of sheet conductance S, S.

    The inflow j on the electrodes satisfies z j - (R/(pi S)) int log|2 sin((t - t')/2)| j(t') dt' = U - g, for given
    net currents; electrodes are alike, so a Fourier transform over them leaves N small systems.
    """
    count, harmonics = electrodes.count, HARMONICS
    (start, stop), *_ = arcs(body, electrodes) - electrodes.first_angle_rad
    t, weight = _nodes((stop - start) / 2)
    kernels = _kernels((stop - start) / 2, count) * (body.radius_m / (np.pi * conductance_S))
    orders = np.concatenate([-np.arange(1, harmonics + 1), np.arange(1, harmonics + 1)])
    waves = np.exp(1j * np.outer(t, orders))
    impedance, driven = np.zeros(count, dtype=complex), np.zeros(2 * harmonics, dtype=complex)
    scattered = np.zeros((2 * harmonics, 2 * harmonics))
    for mode in range(count):
        alike = np.flatnonzero(orders % count == mode)
        phase = np.exp(-2j * np.pi * mode * np.arange(count) / count)
        operator = np.tensordot(phase, kernels, 1) + electrodes.contact_impedance_Ohm_m * np.eye(len(t))
        inflow = np.linalg.solve(operator, np.column_stack([np.ones(len(t)), waves[:, alike]]))
        current = body.radius_m * (weight @ inflow)
        to_field = _field(waves[:, alike], weight, orders[alike], body.radius_m / conductance_S) * count
        floating = inflow[:, :1] * (current[1:] / current[0]) - inflow[:, 1:]
        scattered[np.ix_(alike, alike)] = np.real(to_field @ floating)
        if mode:
            impedance[mode] = 1 / current[0]
            driven[alike] = to_field @ inflow[:, 0] / (current[0] * count)
    apart = np.subtract.outer(np.arange(count), np.arange(count))
    column = np.real(np.fft.ifft(impedance))
    return Rim(column[apart % count], 2 * np.real(driven[harmonics:]), scattered[harmonics:, harmonics:],
               scattered[harmonics:, :harmonics])


def _field(waves: Complex, weight: Array, orders: NDArray[np.integer], scale: float) -> Complex:
    """Rim potential's Fourier coefficients (orders, nodes) of an inflow on one electrode: (R/(|n| S)) j_n."""
    return scale / (2 * np.pi) * (waves.conj() * weight[:, None]).T / np.abs(orders)[:, None]


def _nodes(half: float) -> tuple[Array, Array]:
    """Nodes and weights on (-half, half)."""
    x, w = leggauss(_POINTS)
    ends = _panels(half)
    middle, reach = (ends[1:] + ends[:-1]) / 2, np.diff(ends) / 2
    return (middle[:, None] + reach[:, None] * x).ravel(), (reach[:, None] * w).ravel()


def _panels(half: float) -> Array:
    positive = 1 - _RATIO ** np.arange(_PANELS)
    return half * np.concatenate([-1 + 0 * positive[:1], -positive[:0:-1], positive, [1.0]])


@lru_cache(maxsize=4)
def _kernels(half: float, count: int) -> Array:
    """Integrals (count, nodes, nodes) of -log|2 sin(./2)| against the nodes' interpolants, by electrodes apart."""
    t, weight = _nodes(half)
    apart = np.subtract.outer(t, t)
    far = [-np.log(np.abs(2 * np.sin((apart + 2 * np.pi * d / count) / 2))) * weight for d in range(1, count)]
    half_apart = np.where(apart == 0, 1.0, apart / 2)
    smooth = np.where(apart == 0, 0.0, -np.log(np.sin(half_apart) / half_apart)) * weight
    return np.stack([smooth - _logarithm(t, _panels(half)), *far])


def _logarithm(t: Array, ends: Array) -> Array:
    """Integrals (nodes, nodes) of log|t_i - t'| against the interpolants of the nodes, each panel split at t_i."""
    x, w = leggauss(_LOG_POINTS)
    s = ((x + 1) / 2) ** _LOG_POWER
    ds = w / 2 * _LOG_POWER * ((x + 1) / 2) ** (_LOG_POWER - 1)
    interpolate = np.linalg.inv(legvander(leggauss(_POINTS)[0], _POINTS - 1))
    columns = []
    for a, b in pairwise(ends):
        split = np.clip(t, a, b)
        at = np.concatenate([split[:, None] + (b - split)[:, None] * s, split[:, None] - (split - a)[:, None] * s], 1)
        weight = np.concatenate([(b - split)[:, None] * ds, (split - a)[:, None] * ds], 1)
        distance = np.maximum(np.abs(t[:, None] - at), np.finfo(float).tiny)
        basis = legvander((2 * at - a - b) / (b - a), _POINTS - 1) @ interpolate
        columns.append(np.einsum("iq,iqj->ij", weight * np.log(distance), basis))
    return np.concatenate(columns, axis=1)
