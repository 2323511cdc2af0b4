"""What several touches on one disc scatter of each other: the sum of their signals lacks it.

A touch at z0 answers the n-th derivative of a field F there as a multipole of strength s_n = p_n F^(n)(z0), p_n as in
`multipole_series`, and the electrodes read sum_n Re[s_n conj(G^(n)(z0))]. Its potential elsewhere is that of the
Neumann function of the disc, log|z - w| + log|1 - z conj(w)| over -2, by reciprocity Re h(w) with
h(w) = sum_n (n-1)!/2 [conj(s_n) (w - z0)^-n + s_n (w / (1 - conj(z0) w))^n], over the size V_1 of one unit of field.
Derivatives of h at the other touches join the fields there, and so by turns. Electrodes count as points of an
insulated rim for these fields alone; a touch's own image is in its p_n.
"""

import math

import numpy as np

from surrogate.data.sensor_ring import Ring
from touchcal.arrays import Array, Complex

TURNS = 3  # times that fields are scattered again
MODES = 400  # of the field of two electrodes on the rim


def scatters(ring: Ring) -> bool:
    """Whether what touches scatter of each other is known: on discs."""
    return ring.sheet is None and ring.curved is None


def unit_V(ring: Ring, baseline_V: Array) -> float:
    """V_1 of a disc: the volts of one unit of field, by its untouched readings off driven electrodes."""
    q = ring.modes[:MODES]
    angle = ring.angle_rad[:, None] - ring.angle_rad
    m = np.arange(1, len(q) + 1)
    between = np.cos(angle[..., None] * m) @ (q**2 / m)
    drive = between[ring.source] - between[ring.sink]
    rows = np.arange(len(drive))
    unit = drive[rows, ring.read] - drive[rows, ring.ground]
    free = (ring.read != ring.source) & (ring.read != ring.sink) & (ring.ground != ring.source) & (
        ring.ground != ring.sink)
    return float(unit[free] @ baseline_V[free] / (unit[free] @ unit[free]))


def scattered(ring: Ring, fields: Complex, z: Complex, strength: Array, one_V: float) -> Array:
    """(readings,) what touches at z (k,) of strengths p_n (k, orders), V, scatter of each other, V; fields: derivatives
    (orders + 1 or more, k, electrodes) of the electrodes' fields there."""
    orders, count = strength.shape[1], len(z)
    bare = fields[:orders].transpose(1, 0, 2)  # (k, orders, electrodes)
    onto = np.zeros((2, count, orders, count, orders), complex)  # by conj(s) and by s
    for i in range(count):
        for j in range(count):
            if i != j:
                onto[0, j, :, i], onto[1, j, :, i] = _from(z[i], z[j], orders)
    amount = strength[..., None] / one_V
    total = bare
    for _ in range(TURNS):
        source = amount * total
        total = bare + np.einsum("jmin,ine->jme", onto[0], source.conj()) + np.einsum("jmin,ine->jme", onto[1], source)
    more = strength[..., None] * (total - bare)  # (k, orders, electrodes)
    driven, sensed = more[..., ring.source] - more[..., ring.sink], bare[..., ring.read] - bare[..., ring.ground]
    return np.asarray(np.sum((driven * sensed.conj()).real, axis=(0, 1)))


def _from(z: complex, w: complex, orders: int) -> tuple[Complex, Complex]:
    """(orders, orders) derivatives m = 1 ... of h at w for unit conj(s_n), and for unit s_n, n = 1 ..."""
    away, image = np.zeros((2, orders, orders), complex)
    bent = 1 - np.conj(z) * w
    # w / (1 - conj(z) w) about w as a polynomial of the step, and its powers
    moebius = np.array([w / bent, *(np.conj(z) ** (k - 1) / bent ** (k + 1) for k in range(1, orders + 1))])
    power = np.array([1.0 + 0j, *np.zeros(orders)])
    for n in range(1, orders + 1):
        power = np.convolve(power, moebius)[:orders + 1]
        half = math.factorial(n - 1) / 2
        for m in range(1, orders + 1):
            rising = math.prod(range(n, n + m))
            away[m - 1, n - 1] = half * (-1) ** m * rising * (w - z) ** (-n - m)
            image[m - 1, n - 1] = half * math.factorial(m) * power[m]
    return away, image
