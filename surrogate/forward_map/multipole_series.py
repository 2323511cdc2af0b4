"""The signal of an axisymmetric touch as a multipole series in the harmonic fields of the untouched, uniform disc.

The potential of electrode e under unit current is Re f(z exp(-i angle_e)) with f(z) = sum_m (q_m / m) z^m, z = x + iy
over the radius, real q_m by the ring's mirror symmetry (q_m = 1 for point electrodes; width and shunting lower it). A
change of sheet conductance that is axisymmetric about z0 answers each angular order n of a field separately, so a
reading that drives the field F and reads the field G changes by dV = sum_n p_n Re[F^(n)(z0) conj(G^(n)(z0))]; p_n
depend on the touch alone, up to the reflection of its own field at the rim, which depends on |z0|. Close to the rim the
series does not suffice, and `surrogate.forward_map.rim_correction` learns what it leaves, or the whole signal.

On a skin with an outline f is another analytic function (`surrogate.data.outlined_sheet`), and the series is the same.
"""

import math
from dataclasses import dataclass

import numpy as np

from surrogate.data import outlined_sheet
from surrogate.data.sensor_ring import Ring
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Complex, Index
from touchcal.jit import compiled

ORDERS = 5  # angular orders of the series
PRIOR_SD = 0.1  # spread of q_m about the foreseen ones that is believed before any data
# How many times less than the foreseen field a learned one must leave of the signals: a series that lacks something
# else bends the field to make up for it, and is then wrong elsewhere.
WORTH = 3.0
MAX_ROWS = 200  # rows that the field is learned from, at most; each gives all its readings, so few suffice


@dataclass(frozen=True)
class Strengths:
    """Multipole strengths of single touches, by least squares."""

    value: Array  # (n, ORDERS) p_n, V
    variance: Array  # (n, ORDERS) variance of each up to one common factor
    dipole: Array  # (n,) norm of the signal of a dipole of unit strength
    residual: Array  # (n, readings) what the series leaves of the signal, V


def modes_needed(reach: float) -> int:
    """Terms of f that matter at |z| <= reach: reach^m falls below 1e-5."""
    return int(np.clip(math.log(1e-5) / math.log(min(max(reach, 0.1), 0.95)), 12, 120))


def patterns(ring: Ring, q: Array, z: Complex, orders: int = ORDERS) -> tuple[Complex, Complex]:
    """Derivatives 1 ... orders of the driving and of the reading field at z (n,): two arrays (orders, n, readings)."""
    fields = electrode_fields(ring, q, z, orders)
    return fields[..., ring.source] - fields[..., ring.sink], fields[..., ring.read] - fields[..., ring.ground]


def basis(drive: Complex, read: Complex) -> Array:
    """(n, readings, orders) change of each reading by a multipole of unit strength."""
    return np.moveaxis((drive * read.conj()).real, 0, -1)


def signals(ring: Ring, fields: Complex, part: Array, slope: Array, strength: Array) -> tuple[Array, Array]:
    """The basis (n, readings, ORDERS) where electrodes have these derivatives of their fields (ORDERS + 1 or more, n,
    electrodes) and orders count in parts (n, ORDERS) of slopes (n, ORDERS, 2), and derivatives (n, readings, 2), by x
    and y over the radius, of the signal of strengths (n, ORDERS)."""
    # of one layout, so that the loop is compiled once
    fields, strength = np.ascontiguousarray(fields), np.ascontiguousarray(strength)
    return _signals(fields, ring.source, ring.sink, ring.read, ring.ground, part, slope, strength)


@compiled
def _signals(fields: Complex, source: Index, sink: Index, read: Index, ground: Index, part: Array, slope: Array,
             strength: Array) -> tuple[Array, Array]:
    count, orders = strength.shape
    basis, moved = np.empty((count, len(source), orders)), np.empty((count, len(source), 2))
    for i in range(count):
        for r in range(len(source)):
            by_x, by_y = 0.0, 0.0
            drive, sense = fields[0, i, source[r]] - fields[0, i, sink[r]], fields[0, i, read[r]] - fields[
                0, i, ground[r]]
            for n in range(orders):
                drives = fields[n + 1, i, source[r]] - fields[n + 1, i, sink[r]]
                senses = fields[n + 1, i, read[r]] - fields[n + 1, i, ground[r]]
                value = drive.real * sense.real + drive.imag * sense.imag
                along, against = drives * sense.conjugate(), drive * senses.conjugate()
                basis[i, r, n] = value * part[i, n]
                by_x += strength[i, n] * ((along.real + against.real) * part[i, n] + value * slope[i, n, 0])
                by_y += strength[i, n] * ((against.imag - along.imag) * part[i, n] + value * slope[i, n, 1])
                drive, sense = drives, senses
            moved[i, r, 0], moved[i, r, 1] = by_x, by_y
    return basis, moved


def dipole_norms(ring: Ring, fields: Complex) -> tuple[Array, Array]:
    """Norms (n,) of the readings by a dipole of unit strength, and their slopes (n, 2) by x and y over the radius."""
    one, none = np.ones((fields.shape[1], 1)), np.zeros((fields.shape[1], 1, 2))
    value, moved = signals(ring, fields, one, none, one)
    norm = np.sqrt(np.einsum("nro,nro->n", value, value))
    return norm, np.einsum("nro,nrq->nq", value, moved) / norm[:, None]


def combined(design: Array, strength: Array) -> Array:
    """(n, readings) sum over the orders of a basis (n, readings, orders) times strengths (n, orders)."""
    return (design @ strength[..., None])[..., 0]


def strengths(ring: Ring, q: Array, z: Complex, signal_V: Array) -> Strengths:
    """Strengths of touches at z (n,) with signals (n, readings), each row by itself."""
    return _strengths(basis(*patterns(ring, q, z)), signal_V)


def learn_field(ring: Ring, z: Complex, signal_V: Array) -> Array:
    """q (modes,) with q_1 = 1: those foreseen, or those that leave least of the signals where they leave far less; on a
    skin with an outline, whose fields are solved, none."""
    if ring.sheet is not None:
        return ring.modes
    foreseen, learned = strengths(ring, ring.modes, z, signal_V), _learned(ring, z, signal_V)
    better = strengths(ring, learned, z, signal_V)
    gain = np.linalg.norm(foreseen.residual, axis=1) / np.linalg.norm(better.residual, axis=1)
    return learned if np.median(gain) > WORTH else ring.modes


def _learned(ring: Ring, z: Complex, signal_V: Array, iterations: int = 20) -> Array:
    """q that leaves least of the unit-norm signals, strengths eliminated (Kaufman 1975); modes that do not reach these
    places are those foreseen."""
    kept = spread_evenly(len(z), MAX_ROWS)
    z, unit = z[kept], signal_V[kept] / np.linalg.norm(signal_V[kept], axis=1, keepdims=True)
    q = ring.modes
    learned = min(modes_needed(float(np.abs(z).max())), len(q))
    current = strengths(ring, q, z, unit)
    for _ in range(iterations):
        step = _step(ring, q, z, current, learned)
        for shorten in (1.0, 0.3, 0.1, 0.01):
            trial_q = q + shorten * step
            trial = strengths(ring, trial_q, z, unit)
            if _objective(ring, trial_q, trial, current) < _objective(ring, q, current, current):
                break
        else:
            return q
        small = np.abs(trial_q - q).max() < 1e-4
        q, current = trial_q, trial
        if small:
            break
    return q


def _objective(ring: Ring, q: Array, fit: Strengths, scale: Strengths) -> float:
    prior = np.mean(scale.residual**2) / PRIOR_SD**2
    return float(np.sum(fit.residual**2) + prior * np.sum((q - ring.modes) ** 2))


def _step(ring: Ring, q: Array, z: Complex, fit: Strengths, learned: int) -> Array:
    """Gauss-Newton step of the learned modes from q_2 on, with strengths projected out, under the prior."""
    drive, read = patterns(ring, q, z)
    onto, _ = np.linalg.qr(basis(drive, read))
    columns = []
    for m in range(1, learned):
        d_drive, d_read = patterns(ring, np.eye(len(q))[m], z)
        change = basis(d_drive, read) + basis(drive, d_read)
        moved = combined(change, fit.value)
        columns.append((moved - np.einsum("nkp,njp,nj->nk", onto, onto, moved, optimize=True)).ravel())
    jacobian = np.array(columns)
    prior = np.mean(fit.residual**2) / PRIOR_SD**2 + np.finfo(float).tiny
    normal = jacobian @ jacobian.T + prior * np.eye(learned - 1)
    off = (q - ring.modes)[1:learned]
    step = np.zeros(len(q))
    step[1:learned] = np.linalg.solve(normal, jacobian @ fit.residual.ravel() - prior * off)
    return step


def _strengths(design: Array, signal_V: Array) -> Strengths:
    onto, triangle = np.linalg.qr(design)
    along = np.einsum("nkp,nk->np", onto, signal_V)
    inverse = np.linalg.inv(triangle)
    value = np.einsum("npq,nq->np", inverse, along)
    residual = signal_V - combined(onto, along)
    return Strengths(value, np.sum(inverse**2, axis=2) * np.sum(signal_V**2, axis=1, keepdims=True),
                     np.linalg.norm(design[..., 0], axis=1), residual)


def coefficients_of(q: Array, orders: int) -> Array:
    """(modes, orders) coefficient of z^s in the n-th derivative of f: q_(s+n) / (s+n) times (s+n)! / s!."""
    out = np.zeros((len(q), orders))
    for n in range(1, orders + 1):
        s = np.arange(len(q) - n + 1)
        falling = np.prod([s + n - i for i in range(1, n)], axis=0) if n > 1 else np.ones(len(s))
        out[s, n - 1] = q[s + n - 1] * falling
    return out


def field_series(ring: Ring, q: Array, orders: int) -> Complex:
    """(orders, modes, electrodes) coefficients of the powers of z in derivatives 1 ... orders of the potential of each
    electrode."""
    coefficients, turn = coefficients_of(q, orders).T, np.exp(-1j * ring.angle_rad)
    turns = np.exp(-1j * np.arange(coefficients.shape[1])[:, None] * ring.angle_rad)
    return coefficients[..., None] * turns * turn ** np.arange(1, orders + 1)[:, None, None]


def fields_at(series: Complex, z: Complex) -> Complex:
    """(orders, n, electrodes) derivatives of the potential of each electrode at z (n,), by their series."""
    powers = np.ones((len(z), series.shape[1]), complex)
    powers[:, 1:] = z[:, None]
    np.cumprod(powers, axis=1, out=powers)
    return powers @ series


def electrode_fields(ring: Ring, q: Array, z: Complex, orders: int) -> Complex:
    """(orders, n, electrodes) derivatives 1 ... orders of the potential of each electrode at z (n,)."""
    if ring.sheet is not None:
        return outlined_sheet.fields(ring.sheet, z, orders)
    return fields_at(field_series(ring, q, orders), z)
