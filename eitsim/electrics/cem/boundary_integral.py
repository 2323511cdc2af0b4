"""The untouched skin without a mesh: harmonic series inside the disc, an integral equation for its line electrodes."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from scipy.linalg import block_diag, solve

from eitsim.electrics.cem.uneven_sheet import MODES, rim_change
from eitsim.scene.electrodes import arcs, contact_impedances, identical, round_the_rim
from eitsim.scene.scene import Body, Electrodes
from touchcal.arrays import Array, Complex

# Gauss points in a panel, panels from the middle of an electrode to its end, and the ratio of neighbours' lengths;
# the angle, over the wave length of the last harmonic by 2 pi, that no panel exceeds.
_POINTS, _PANELS, _RATIO, _LONGEST = 10, 9, 0.25, 7.5
# Points of the rule that integrates the logarithm on a panel, and the power that smooths it.
_LOG_POINTS, _LOG_POWER = 32, 6
# Points of a panel on which the potential of the other electrodes is interpolated to twelve digits where they are at
# least _FAR panel lengths away, and the most such panels from the middle to an end.
_SMOOTH_POINTS, _FAR, _SMOOTH_PANELS = 16, 0.95, 5
_MOST_COUPLED = 4500  # The most unknowns that couple electrodes which are not identical.
HARMONICS = 192  # Harmonics around the rim.
# Step of ln width between the middles of intervals, and widths of one that are interpolated (1e-9).
_WIDTH_STEP, _WIDTHS = 0.1, 5
# Gaps count as this much wider where six digits are enough.
_SIX_DIGITS = 4.5


@dataclass(frozen=True, eq=False)
class Rim:
    """A homogeneous disc with N line electrodes. Fields are Re sum_{n>0} a_n (r/R)^n exp(i n theta), theta from the
    electrodes' first angle."""

    impedance_Ohm: Array  # (N, N) impedance, Ohm; rows and columns sum to zero
    driven: Complex  # (h, N) a_n, V, of 1 A into each electrode and 1/N A out of every one
    # (h, h) twice: rim potential Re sum g_n exp(i n theta) of an inner source on a rim without electrodes -> the field
    # same @ g + crossed @ conj(g) that the floating electrodes add
    same: Complex
    crossed: Complex


@dataclass(frozen=True, eq=False)
class _Alone:
    """What flows into one electrode alone on the rim, over pi S, theta from its middle, by what drives it: its own
    potential U, the potential that other electrodes raise at its smooth nodes, and exp(i n theta) on the rim."""

    theta: Array  # (p,) smooth nodes, rad
    total: float  # current by U
    charge: Array  # (p,) charges at the smooth nodes by U, which is the current by the potential at each
    charges: Array  # (p, p) charges by the potential at the smooth nodes
    # (h,) current and (p, h) charges by exp(i n theta)
    total_by_wave: Complex
    charge_by_wave: Complex
    # (h, h) twice: component exp(i n theta) of the inflow by exp(i m theta) and by exp(-i m theta)
    same: Complex
    mirrored: Complex


@lru_cache(maxsize=64)
def solve_rim(body: Body, electrodes: Electrodes, conductance_S: float) -> Rim:
    """Solve the complete electrode model of a homogeneous disc of sheet conductance S, S; arrays are read-only.

    The inflow j on the electrodes satisfies z j - (R/(pi S)) int log|2 sin((t - t')/2)| j(t') dt' = U - g, for given
    net currents. Each electrode is solved alone; what the others do to it is smooth there, and its values at a few
    nodes couple them: in one dense system, or by a Fourier transform over electrodes that are identical.

    ValueError for patches, and what `unsolvable` tells.
    """
    if not electrodes.along_edge:
        raise ValueError(f"the rim is solved for line electrodes, got kind \"{electrodes.kind}\"; patches need a mesh.")
    if problem := unsolvable(body, electrodes, conductance_S):
        raise ValueError(problem)
    ends, layers = arcs(body.radius_m, electrodes), conductance_S * contact_impedances(electrodes) / body.radius_m
    alone = [_alone((stop - start) / 2, np.pi * float(layer), before, after)
             for (start, stop), layer, (before, after) in zip(ends, layers, _smooth_panels(ends), strict=True)]
    middle = ends.mean(axis=1) - electrodes.first_angle_rad
    impedance, driven, same, crossed = _together(alone, middle, _coupled_alike if identical(electrodes) else _coupled)
    unit = 1 / (np.pi * conductance_S)
    rim = Rim(unit * (impedance + impedance.T) / 2, unit * driven, same, crossed)
    for part in (rim.impedance_Ohm, rim.driven, rim.same, rim.crossed):
        part.flags.writeable = False
    return rim


def _together(alone: list[_Alone], middle: Array, couple: Callable[..., Array]) -> tuple[Array, Complex, Complex,
                                                                                          Complex]:
    """The parts of Rim for pi S = 1, from what each electrode does alone and what couples them."""
    count, n = len(alone), np.arange(1, HARMONICS + 1)
    turn: Complex = np.exp(1j * np.outer(middle, n))
    by_wave: Complex = np.vstack([one.charge_by_wave * t for one, t in zip(alone, turn, strict=True)])
    by_voltage = np.asarray(block_diag(*[one.charge[:, None] for one in alone]))
    felt = couple([one.theta + at for one, at in zip(alone, middle, strict=True)], [one.charges for one in alone],
                  np.hstack([by_voltage, -by_wave.real, -by_wave.imag]))
    by_waves = felt[:, count:count + len(n)] + 1j * felt[:, count + len(n):]
    total_by_wave = np.stack([one.total_by_wave for one in alone]) * turn
    admittance = np.diag([one.total for one in alone]) - by_voltage.T @ felt[:, :count]
    field = (total_by_wave.conj().T - by_wave.conj().T @ felt[:, :count]) / (2 * n[:, None])
    voltage = np.linalg.solve(admittance, np.eye(count) - 1 / count)
    floating = np.linalg.solve(admittance, total_by_wave + by_voltage.T @ by_waves)
    same, mirrored = _still(alone, turn)
    same = field @ floating - (same + by_wave.conj().T @ by_waves) / (2 * n[:, None])
    crossed = field @ floating.conj() - (mirrored + by_wave.conj().T @ by_waves.conj()) / (2 * n[:, None])
    return voltage - voltage.mean(axis=0), 2 * field @ voltage, same, crossed


@lru_cache(maxsize=8)
def unsolvable(body: Body, electrodes: Electrodes, conductance_S: float) -> str:
    """Why `solve_rim` refuses these line electrodes, with the remedy; empty where it does not.

    Electrodes that touch with so low a contact impedance that the current between them crowds on less, S z, than is
    resolved; or unlike ones that are too many and too close for the dense system that couples them.
    """
    ends, layer = arcs(body.radius_m, electrodes), conductance_S * contact_impedances(electrodes) / body.radius_m
    half = np.diff(ends)[:, 0] / 2
    order, _, gaps = round_the_rim(ends)
    after = np.roll(order, -1)
    crowd = np.maximum(gaps, np.minimum(layer[order], layer[after]))
    finest = np.maximum(half[order], half[after]) * _RATIO ** (_PANELS - 1)
    if np.any(crowd < finest):
        k = int(np.argmin(crowd / finest))
        return (f"electrodes {order[k]} and {after[k]} of those that have contact (from 0) touch, and their "
                "contact impedance is so low that nearly all current flows across their common end; leave a gap of "
                f"{finest[k] * body.radius_m * 1e3:.1g} mm, or give them "
                f"{finest[k] * body.radius_m / conductance_S:.1g} Ohm m.")
    own = [len(_smooth_nodes(_panels(h), *panels)[0]) for h, panels in zip(half, _smooth_panels(ends), strict=True)]
    if sum(own) > _MOST_COUPLED and not identical(electrodes):
        return (f"{len(ends)} electrodes that are not identical and this close to each other need {sum(own)} "
                f"coupled unknowns, at most {_MOST_COUPLED} are solved; leave wider gaps, or make them identical.")
    return ""


def _gaps(ends: Array) -> Array:
    """Gaps (count, 2), rad, before and after each electrode, counter-clockwise."""
    order, _, gaps = round_the_rim(ends)
    return np.stack([np.roll(gaps, 1), gaps], axis=1)[np.argsort(order)]


def _smooth_panels(ends: Array) -> list[tuple[int, int]]:
    """Panels of each electrode from its middle to either end, as `_panels_to` tells."""
    width = np.diff(ends)[:, 0].tolist()
    return [(_panels_to(before, w), _panels_to(after, w))
            for (before, after), w in zip(_gaps(ends).tolist(), width, strict=True)]


def _panels_to(gap: float, width: float) -> int:
    """Panels from the middle of an electrode to the end next to a gap on which another electrode's potential is smooth:
    0 for one on the whole electrode, each next half as long; -1 where only the electrode's own panels will do."""
    far = gap / (width / 2)
    if far >= 2 * _FAR:
        return 0
    requested = 1 + max(math.ceil(math.log2(_FAR / far)), 0) if far > 0 else math.inf
    return int(requested) if requested <= _SMOOTH_PANELS else -1


@lru_cache(maxsize=256)
def _alone(half: float, layer: float, before: int, after: int) -> _Alone:
    """One electrode; half its angle, and S z pi / R."""
    panels = _panels(half)
    t, weight = _nodes(np.array(panels))
    smooth, onto = _smooth_nodes(panels, before, after)
    waves: Complex = np.exp(1j * np.outer(half * t, np.arange(1, HARMONICS + 1)))
    drive = np.column_stack([np.ones(len(t)), onto, waves.real, waves.imag])
    separation = half * np.abs(np.subtract.outer(t, t)) / 2
    curve = np.log(np.sinc(separation / np.pi))
    kernel = half * ((-curve - math.log(half)) * weight - _logarithm(panels))
    gram = half * (weight[:, None] * drive).T @ np.linalg.solve(kernel + layer * np.eye(len(t)), drive)
    gram = (gram + gram.T) / 2
    own = slice(1, 1 + len(smooth))
    re, im = (slice(own.stop + start, own.stop + start + HARMONICS) for start in (0, HARMONICS))
    return _Alone(half * smooth, float(gram[0, 0]), gram[0, own], gram[own, own], gram[0, re] + 1j * gram[0, im],
                  gram[own, re] + 1j * gram[own, im],
                  gram[re, re] + gram[im, im] + 1j * (gram[re, im] - gram[im, re]),
                  gram[re, re] - gram[im, im] - 1j * (gram[re, im] + gram[im, re]))


def _coupled(theta: list[Array], charges: list[Array], sources: Array) -> Array:
    """Potential phi (M, k) that all electrodes' charges raise at the smooth nodes of the others, phi = K (q - E phi),
    K = -log|2 sin|, E the charges that phi takes away, q those of the sources (M, k)."""
    at, first = np.concatenate(theta), np.cumsum([0, *(len(t) for t in theta)])
    matrix, raised = np.eye(len(sources)), np.empty_like(sources)
    for own in (slice(a, b) for a, b in pairwise(first)):
        kernel = _kernel(at[own], at)
        kernel[:, own] = 0.0
        raised[own] = kernel @ sources
        for block, (a, b) in zip(charges, pairwise(first), strict=True):
            matrix[own, a:b] += kernel[:, a:b] @ block
    return solve(matrix, raised, overwrite_a=True)


def _coupled_alike(theta: list[Array], charges: list[Array], sources: Array) -> Array:
    """As `_coupled` for identical electrodes, evenly spaced: one small system for each mode around the ring."""
    count, p = len(theta), len(theta[0])
    kernels = np.stack([np.zeros((p, p)), *(_kernel(t, theta[0]) for t in theta[1:])])
    modes, driven = np.fft.rfft(kernels, axis=0), np.fft.rfft(sources.reshape(count, p, -1), axis=0)
    felt = np.linalg.solve(np.eye(p) + modes @ charges[0], modes @ driven)
    return np.fft.irfft(felt, count, axis=0).reshape(count * p, -1)


def _kernel(to: Array, source: Array) -> Array:
    """-log|2 sin| of half the angles (to, source); infinite where they agree."""
    with np.errstate(divide="ignore"):
        return -np.log(np.abs(2 * np.sin(np.subtract.outer(to, source) / 2)))


def _still(alone: list[_Alone], turn: Complex) -> tuple[Complex, Complex]:
    """Sums of what the electrodes, each alone and at 0 V, take from exp(i m theta) and exp(-i m theta)."""
    kinds = {id(one): one for one in alone}
    same, mirrored = np.zeros((2, HARMONICS, HARMONICS), dtype=complex)
    for key, one in kinds.items():
        turns = turn[[id(other) == key for other in alone]]
        same += one.same * (turns.conj().T @ turns)
        mirrored += one.mirrored * (turns.conj().T @ turns.conj())
    return same, mirrored


def _panels(half: float) -> tuple[float, ...]:
    """Ends of an electrode's own panels on (-1, 1), none longer than what resolves the last harmonic."""
    graded = 1 - np.append(_RATIO ** np.arange(_PANELS), 0.0)
    parts = np.ceil(np.diff(graded) * half * HARMONICS / _LONGEST).astype(int)
    steps = np.concatenate([[0.0], np.cumsum(1 / np.repeat(parts, parts))])
    positive = np.interp(steps, np.arange(len(graded)), graded)
    return (*(-positive[:0:-1]).tolist(), *positive.tolist())


def _nodes(ends: Array, points: int = _POINTS) -> tuple[Array, Array]:
    x, w = leggauss(points)
    middle, reach = (ends[1:] + ends[:-1]) / 2, np.diff(ends) / 2
    return (middle[:, None] + reach[:, None] * x).ravel(), (reach[:, None] * w).ravel()


@lru_cache(maxsize=32)
def _smooth_nodes(panels: tuple[float, ...], before: int, after: int) -> tuple[Array, Array]:
    """Nodes (p,) on (-1, 1) for a smooth potential, and the matrix (n, p) that takes it to the electrode's own."""
    t, _ = _nodes(np.array(panels))
    if before < 0 or after < 0:
        return t, np.eye(len(t))
    left, right = (1 - 0.5 ** np.append(np.arange(1, parts), np.inf) for parts in (before, after))
    middle = [0.0] if before or after else []
    ends = np.concatenate([-left[::-1], middle, right])
    nodes, _ = _nodes(ends, _SMOOTH_POINTS)
    interpolate = np.linalg.inv(legvander(leggauss(_SMOOTH_POINTS)[0], _SMOOTH_POINTS - 1))
    onto = np.zeros((len(t), len(nodes)))
    for i, (a, b) in enumerate(pairwise(ends)):
        inside = (t > a) & (t < b)
        at = legvander((2 * t[inside] - a - b) / (b - a), _SMOOTH_POINTS - 1)
        onto[inside, i * _SMOOTH_POINTS:(i + 1) * _SMOOTH_POINTS] = at @ interpolate
    return nodes, onto


@lru_cache(maxsize=4)
def _logarithm(panels: tuple[float, ...]) -> Array:
    """Integrals (n, n) of log|t_i - t'| against the interpolants of an electrode's own nodes on (-1, 1), each panel
    split at t_i."""
    t, _ = _nodes(np.array(panels))
    x, w = leggauss(_LOG_POINTS)
    s = ((x + 1) / 2) ** _LOG_POWER
    ds = w / 2 * _LOG_POWER * ((x + 1) / 2) ** (_LOG_POWER - 1)
    interpolate = np.linalg.inv(legvander(leggauss(_POINTS)[0], _POINTS - 1))
    columns = []
    for a, b in pairwise(panels):
        split = np.clip(t, a, b)
        at = np.concatenate([split[:, None] + (b - split)[:, None] * s, split[:, None] - (split - a)[:, None] * s], 1)
        weight = np.concatenate([(b - split)[:, None] * ds, (split - a)[:, None] * ds], 1)
        distance = np.maximum(np.abs(t[:, None] - at), np.finfo(float).tiny)
        basis = legvander((2 * at - a - b) / (b - a), _POINTS - 1) @ interpolate
        columns.append(np.einsum("iq,iqj->ij", weight * np.log(distance), basis))
    return np.concatenate(columns, axis=1)


@dataclass(frozen=True, eq=False)
class RimAdmittance:
    """Admittance of a homogeneous disc's line electrodes, currents into them by their potentials, and its
    derivatives."""

    admittance_S: Array  # (N, N), S; rows and columns sum to zero
    by_layer: Array  # (N, N, N) S; [k]: by S z / R of electrode k
    by_angle: Array  # (N, N, N) S/rad; [k]: by the angle of the middle of electrode k
    by_width: Array  # (N, N, N) S; [k]: by ln of the width of electrode k; 0 where it touches a neighbour
    by_sheet: Array  # (modes, N, N) S; by each mode of ln of the sheet conductance (`uneven_sheet`)


def rim_admittance(body: Body, electrodes: Electrodes, conductance_S: float,
                   modes: Array | None = None) -> RimAdmittance:
    """The inverse of `solve_rim`'s impedance, Y = T - B' (1 + K E)^-1 K B, with its derivatives by contact impedances,
    widths and places; modes: how uneven the sheet is (`uneven_sheet`), which K holds. ValueError for patches, missing
    electrodes, and what `unsolvable` tells.

    T, B and E are what electrodes do alone, K couples them. With phi = (1 + K E)^-1 K B and the charges q = B - E phi,
    dY = dT - dB' phi - phi' dB + phi' dE phi - q' dK q: no system is solved twice.
    """
    if not electrodes.along_edge or electrodes.missing:
        raise ValueError("the admittance of the rim is built for line electrodes which all have contact.")
    if problem := unsolvable(body, electrodes, conductance_S):
        raise ValueError(problem)
    ends, layers = arcs(body.radius_m, electrodes), conductance_S * contact_impedances(electrodes) / body.radius_m
    gaps, width = _SIX_DIGITS * _gaps(ends), np.diff(ends)[:, 0]
    parts = [_inflow(w / 2, np.pi * float(layer), _panels_to(before, w), _panels_to(after, w))
             for (before, after), w, layer in zip(gaps.tolist(), width.tolist(), layers, strict=True)]
    middle, count = ends.mean(axis=1), len(ends)
    at = np.concatenate([one.theta + m for one, m in zip(parts, middle, strict=True)])
    edges = np.cumsum([0, *(len(one.theta) for one in parts)])
    own = [slice(a, b) for a, b in pairwise(edges)]
    kernel, slope = _kernel(at, at), -0.5 / np.tan(np.subtract.outer(at, at) / 2 + np.eye(len(at)))
    system = np.eye(len(at))
    charge = np.zeros((len(at), count))
    for k, block in enumerate(own):
        kernel[block, block] = slope[block, block] = 0.0
        charge[block, k] = parts[k].gram[0, 1:]
    uneven = rim_change(at, np.zeros(len(MODES)) if modes is None else modes, HARMONICS)
    kernel, slope = kernel + uneven.kernel, slope + uneven.slope
    for block, one in zip(own, parts, strict=True):
        system[:, block] += kernel[:, block] @ one.gram[1:, 1:]
    phi = solve(system, kernel @ charge, overwrite_a=True)
    flow = charge.copy()  # q
    for block, one in zip(own, parts, strict=True):
        flow[block] -= one.gram[1:, 1:] @ phi[block]
    admittance = np.diag([one.gram[0, 0] for one in parts]) - charge.T @ phi
    by_layer, by_angle, by_width = np.empty((3, count, count, count))
    for k, (block, one) in enumerate(zip(own, parts, strict=True)):
        felt = np.vstack([np.eye(count)[k], -phi[block]])
        by_layer[k] = np.pi * felt.T @ one.by_layer @ felt
        pushed = slope[block] @ flow
        turned, stretched = flow[block].T @ pushed, flow[block].T @ (one.theta[:, None] * pushed)
        by_angle[k] = -(turned + turned.T)
        by_width[k] = felt.T @ one.by_width @ felt - one.resolved * (stretched + stretched.T)
    # the potential of the disc floats: what sums to a net current is left out
    floating = np.eye(count) - np.outer(admittance.sum(axis=1), np.ones(count)) / admittance.sum()
    unit = np.pi * conductance_S

    def floated(part: Array) -> Array:
        return unit * floating @ (part + np.swapaxes(part, -1, -2)) / 2 @ floating.T

    return RimAdmittance(floated(admittance), floated(by_layer), floated(by_angle), floated(by_width),
                         floated(-uneven.by_sheet(flow)))


@dataclass(frozen=True, eq=False)
class _Inflow:
    """What flows into one electrode alone of a certain contact impedance, over pi S."""

    theta: Array  # (p,) smooth nodes, rad from its middle
    gram: Array  # (1 + p, 1 + p) currents and charges by its potential and by that at its smooth nodes
    by_layer: Array  # their derivative by S z pi / R
    by_width: Array  # their derivative by ln of the width
    resolved: bool  # whether there is one


def _inflow(half: float, layer: float, before: int, after: int) -> _Inflow:
    """Of an electrode of half an angle, rad: interpolated between widths that are solved once, where it touches no
    neighbour, since then its smooth nodes do not follow its panels."""
    if min(before, after) < 0:
        alone = _by_layer(round(half, 12), before, after)
        gram, change = alone.inflow(layer)
        return _Inflow(alone.theta, gram, change, np.zeros_like(gram), resolved=False)
    middle = _WIDTH_STEP * round(math.log(half) / _WIDTH_STEP)
    nodes = middle + _WIDTH_STEP / 2 * np.linspace(-1, 1, _WIDTHS)
    solved = [_by_layer(float(np.exp(node)), before, after) for node in nodes.tolist()]
    basis = np.linalg.inv(np.vander((nodes - middle) / _WIDTH_STEP, increasing=True))
    power = ((math.log(half) - middle) / _WIDTH_STEP) ** np.arange(_WIDTHS)
    weight, slope = power @ basis, np.arange(1, _WIDTHS) * power[:-1] @ basis[1:] / _WIDTH_STEP
    grams, changes = (np.stack(each) for each in zip(*(one.inflow(layer) for one in solved), strict=True))
    return _Inflow(solved[0].theta * half / float(np.exp(nodes[0])), np.tensordot(weight, grams, 1),
                   np.tensordot(weight, changes, 1), np.tensordot(slope, grams, 1), resolved=True)


@dataclass(frozen=True, eq=False)
class _ByLayer:
    """One electrode alone for any contact impedance: theta as in `_Alone`, and its operator's eigenvalues (n,) and
    vectors, applied to a constant and to the smooth nodes (n, 1 + p)."""

    theta: Array
    eigenvalues: Array
    drive: Array

    def inflow(self, layer: float) -> tuple[Array, Array]:
        """(1 + p, 1 + p) currents and charges by the electrode's potential and by that at its smooth nodes, and their
        derivative, for S z pi / R."""
        part = self.drive / (self.eigenvalues + layer)[:, None]
        return self.drive.T @ part, -part.T @ part


@lru_cache(maxsize=128)
def _by_layer(half: float, before: int, after: int) -> _ByLayer:
    panels = _panels(half)
    t, weight = _nodes(np.array(panels))
    smooth, onto = _smooth_nodes(panels, before, after)
    values, vectors = _modes(half)
    drive = np.sqrt(half * weight)[:, None] * np.column_stack([np.ones(len(t)), onto])
    return _ByLayer(half * smooth, values, vectors.T @ drive)


@lru_cache(maxsize=64)
def _modes(half: float) -> tuple[Array, Array]:
    """Eigenvalues and vectors of the operator that `_alone` solves, made symmetric by the weights of its nodes."""
    panels = _panels(half)
    t, weight = _nodes(np.array(panels))
    curve = np.log(np.sinc(half * np.abs(np.subtract.outer(t, t)) / 2 / np.pi))
    root = np.sqrt(weight)
    operator = half * ((-curve - math.log(half)) * np.outer(root, root) - root[:, None] * _logarithm(panels) / root)
    return np.linalg.eigh((operator + operator.T) / 2)
