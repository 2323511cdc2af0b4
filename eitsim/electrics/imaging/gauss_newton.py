"""Difference images of the skin's conductance: one regularised Gauss-Newton step from the untouched, uniform skin.

x = (J'J + l R)^-1 J' dV, with dV the touched less the untouched readings, x the relative change of sheet conductance
of each triangle of a coarse mesh, J the derivative of the readings by x on a fine mesh, and R the prior:
"noser", diag(J'J)^1/2 (Cheney et al. 1990, DOI 10.1002/ima.1850020203, with the exponent 1/2), or "laplace", the
squared differences of neighbours over their distance: of simulated touches it is 2 mm off, noser 7 mm, but its images
ring twice as much (benchmarks/reconstruction.py). l is chosen by the noise figure (Adler and Guardo 1996,
DOI 10.1109/42.491418): NF = SNR of the readings over SNR of the image for a small target in the middle, 0.5 by default
as in GREIT. A signal-to-noise ratio is the mean magnitude over the root mean square of white noise; pixels count with
their areas.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import root_scalar
from scipy.spatial import Delaunay, KDTree

from eitsim.electrics.cem.adjoint import impedance_by_conductance, impedance_by_field
from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh, centred, potentials, quadrature_points
from eitsim.electrics.cem.uneven_sheet import MODES, sheet_modes
from eitsim.electrics.forward.skins import skin_of
from eitsim.electrics.outline.triangles import refined, triangulated
from eitsim.scene.channels import Channels, channel_changes, channel_readings
from eitsim.scene.drive import Drive, protocol
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import among_all, contact_impedances, present
from eitsim.scene.scene import Body, Electrodes

PRIORS = ("noser", "laplace")
NOISE_FIGURE = 0.5
RINGS = 12  # Rings of the coarse mesh; it has 6 n^2 triangles.
# Largest pixel of an outline over its mean, and the least number of triangles of the fine mesh in one.
_LARGEST, _FINER = 2.2, 4
_SIDE = 64  # Squares along a side of the grid of `on_grid`.
# Weights that are tried, decades over the largest eigenvalue, and how far inside the range that they have a noise
# figure is taken where the usual one lies outside it.
_DECADES, _INSIDE = (-13, 5), 1.1
_TARGET = 0.1  # Radius of the noise figure's target, in disc radii.
_CONSTANT = 1e-6  # Part of its mean diagonal that is added to the Laplacian, which does not see a constant.
# Steps towards the untouched resistance, the relative change at which they end, and the first conductance, S.
_STEPS, _SETTLED, _FIRST_S = 20, 1e-10, 1e-3


@dataclass(frozen=True, eq=False)
class Pixels:
    """A coarse triangulation of the skin."""

    nodes_m: Array  # (n, 2) corners, m
    triangles: Indices  # (t, 3) corners of each triangle, counter-clockwise
    centre_m: Array  # (t, 2) centroids, m
    area_m2: Array  # (t,) areas, m^2
    body: Body  # the skin's


@dataclass(frozen=True, eq=False)
class Untouched:
    """A uniform skin whose readings fit an untouched frame, and their derivatives by pixels."""

    pixels: Pixels
    conductance_S: float  # sheet conductance, S
    readings_V: Array  # (readings,) V; NaN where an electrode without contact is needed
    # (readings, t) derivatives of the readings by the relative change of each pixel's conductance, V; 0 there
    jacobian_V: Array


@dataclass(frozen=True, eq=False)
class Imager:
    """A linear map from differences of readings to images."""

    untouched: Untouched
    matrix: Array  # (t, readings) relative change of conductance a volt
    # weight of the prior, V^2
    weight: float
    noise_figure: float

    def __call__(self, signal_V: Array) -> Array:
        """Images (..., t) of differences of readings (..., readings), V."""
        return signal_V @ self.matrix.T


def pixels(radius_m: float, rings: int = RINGS) -> Pixels:
    """A disc in 6 rings^2 triangles of nearly one size: ring k holds 6 k corners."""
    angles = [2 * np.pi * np.arange(6 * k) / (6 * k) for k in range(1, rings + 1)]
    corners = [k / rings * np.column_stack([np.cos(a), np.sin(a)]) for k, a in enumerate(angles, start=1)]
    nodes = radius_m * np.vstack([np.zeros((1, 2)), *corners])
    triangles = Delaunay(nodes).simplices
    first, second = (nodes[triangles[:, i]] - nodes[triangles[:, 0]] for i in (1, 2))
    area = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    triangles = np.where((area < 0)[:, None], triangles[:, [0, 2, 1]], triangles)
    return Pixels(nodes, triangles, nodes[triangles].mean(axis=1), np.abs(area), Body(Disc(radius_m)))


def pixels_of(body: Body, rings: int = RINGS) -> Pixels:
    """A skin in some 6 rings^2 triangles of nearly one size."""
    if not body.has_outline:
        return pixels(body.radius_m, rings)
    even = body.edge.area_m2 / (6 * rings**2) * _LARGEST
    found = refined(triangulated(body.outline), lambda places_m: np.full(len(places_m), even))
    return Pixels(found.corners_m, found.cells, found.centres_m, found.area_m2, body)


def fitted(body: Body, electrodes: Electrodes, drive: Drive, baseline_V: Array,
           channels: Channels | None = None) -> Untouched:
    """The uniform skin that fits untouched readings (readings,) best, its contact impedances those of the electrodes,
    read through channels where they are given. A reading that is NaN was not measured: it has no part in the fit.

    ValueError where the readings have another count, or no conductance fits them.
    """
    mesh, passed = _fine(body, present(electrodes)), channels or Channels()
    resistance = 1 / (passed.conductance_S[0] if passed.conductance_S else _FIRST_S)
    for _ in range(_STEPS):
        potential, readings, slope = _uniform(mesh, electrodes, drive, passed, 1 / resistance)
        if readings.shape != baseline_V.shape:
            raise ValueError(f"the frame has {baseline_V.size} readings, electrodes and drive make {readings.size}; "
                             "check [electrodes] and [drive].")
        slope = np.where(np.isnan(baseline_V), 0.0, slope)
        step = float(slope @ np.nan_to_num(baseline_V - readings) / (slope @ slope)) if slope.any() else np.nan
        if abs(step) <= _SETTLED * resistance:
            return measured(_untouched(body, electrodes, drive, passed, mesh, 1 / resistance, potential, readings),
                            ~np.isnan(baseline_V))
        resistance += step
        if not resistance > 0:
            break
    raise ValueError("no uniform conductance fits the untouched readings: their signs or their order may be others; "
                     "check [electrodes], [drive] and the contact impedance.")


def uniform(body: Body, electrodes: Electrodes, drive: Drive, channels: Channels | None = None) -> Untouched:
    """A uniform skin of nominal conductance, for readings whose size says nothing of it."""
    mesh, passed = _fine(body, present(electrodes)), channels or Channels()
    conductance_S = passed.conductance_S[0] if passed.conductance_S else _FIRST_S
    potential, readings, _ = _uniform(mesh, electrodes, drive, passed, conductance_S)
    return _untouched(body, electrodes, drive, passed, mesh, conductance_S, potential, readings)


def measured(untouched: Untouched, there: NDArray[np.bool_]) -> Untouched:
    """The skin without the readings that are not `there` (readings,): NaN, and no derivative."""
    return replace(untouched, readings_V=np.where(there, untouched.readings_V, np.nan),
                   jacobian_V=np.where(there[:, None], untouched.jacobian_V, 0.0))


def _untouched(body: Body, electrodes: Electrodes, drive: Drive, channels: Channels, mesh: SkinMesh,
               conductance_S: float, potential: Array, readings: Array) -> Untouched:
    mosaic = pixels_of(body)
    by_pixel = impedance_by_conductance(mesh, potential, _places(quadrature_points(mesh), mosaic))
    jacobian = _by(drive, electrodes, channels, _ends(mesh, potential), by_pixel) * conductance_S
    return Untouched(mosaic, conductance_S, readings, jacobian)


def pixel_signals(body: Body, electrodes: Electrodes, drive: Drive, channels: Channels, mosaic: Pixels,
                  weight: Array | None = None) -> Array:
    """dV (readings, t), V, by a relative change of conductance on each pixel of a sheet that may vary smoothly, as
    channels say, with which its readings are taken; (readings, k) of sums of pixels by weights (k, t)."""
    mesh = _fine(body, present(electrodes))
    points = quadrature_points(mesh)
    modes = np.array(channels.sheet_modes or (0.0,) * len(MODES))
    sheet = channels.conductance_S[0] * np.exp(np.tensordot(modes, sheet_modes(body, points), 1))
    potential = potentials(mesh, sheet[..., None, None] * np.eye(2), contact_impedances(present(electrodes)))
    by_pixel = impedance_by_conductance(mesh, potential, _places(points, mosaic))
    here = channels.conductance_S[0] * np.exp(np.tensordot(modes, sheet_modes(body, mosaic.centre_m), 1))
    by_pixel = here[:, None, None] * by_pixel
    summed = by_pixel if weight is None else np.tensordot(weight, by_pixel, 1)
    return _by(drive, electrodes, channels, _ends(mesh, potential), summed)


def check_prior(prior: str, noise_figure: float | None) -> None:
    """ValueError, before anything is solved, for an unknown prior, or a noise figure that is not positive."""
    if prior not in PRIORS:
        raise ValueError(f"prior '{prior}' is unknown; known: {', '.join(PRIORS)}.")
    if noise_figure is not None and not 0 < noise_figure < np.inf:
        raise ValueError(f"noise figure {noise_figure:g}: it must be positive and finite; {NOISE_FIGURE:g} is usual.")


def imager(untouched: Untouched, *, prior: str = "laplace", noise_figure: float | None = None) -> Imager:
    """The reconstruction with a prior, its weight chosen so that the noise figure is the given one; None: NOISE_FIGURE,
    or the nearest to it that these readings have.

    ValueError for an unknown prior, or a given noise figure that no weight has.
    """
    check_prior(prior, noise_figure)
    jacobian = untouched.jacobian_V
    spread = _solved(prior, untouched, jacobian.T)
    value, vector = np.linalg.eigh(jacobian @ spread)
    target = jacobian @ _target(untouched.pixels)

    def matrix(log_weight: float) -> Array:
        return (spread @ vector) / (np.maximum(value, 0) + np.exp(log_weight)) @ vector.T

    def figure(log_weight: float) -> float:
        return _noise_figure(matrix(log_weight), target, untouched.pixels.area_m2)

    weights = np.log(value[-1]) + np.log(10.0) * np.arange(*_DECADES)
    figures = np.array([figure(one) for one in weights])
    least, most = float(figures.min()), float(figures.max())
    aim = noise_figure
    if aim is None:
        aim = min(max(NOISE_FIGURE, _INSIDE * least), most / _INSIDE)
    if not least < aim < most:
        raise ValueError(f"noise figure {aim:g} cannot be had; with the prior '{prior}' it lies between {least:.2g} "
                         f"and {most:.2g} for these readings. Give a noise_figure (--noise-figure) between them, or "
                         "none for the nearest to the usual one.")
    crossed = int(np.flatnonzero(np.diff(figures > aim))[0])  # the figure need not fall as the weight grows
    log_weight = root_scalar(lambda at: figure(at) - aim, bracket=tuple(weights[crossed:crossed + 2]), xtol=1e-6).root
    return Imager(untouched, matrix(log_weight), float(np.exp(log_weight)), figure(log_weight))


def on_grid(mosaic: Pixels, images: Array) -> tuple[Array, Array, Array]:
    """Points (n, 2), m, areas (n,), m^2, and images (..., n) on the squares of a grid inside the skin."""
    low, high = mosaic.nodes_m.min(axis=0), mosaic.nodes_m.max(axis=0)
    side = float((high - low).max()) / _SIDE
    counts = np.maximum(np.round((high - low) / side), 1).astype(int)
    axes = [start + (np.arange(n) + 0.5) * side for start, n in zip(low, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    points = points[mosaic.body.edge.gap_m(points) > 0]
    return points, np.full(len(points), side**2), images[..., _places(points, mosaic)]


def _target(mosaic: Pixels) -> NDArray[np.bool_]:
    """(t,) the pixels of the noise figure's target: about the disc's middle, or the pixel farthest from all edges."""
    middle = mosaic.body.edge.inmost_m(mosaic.centre_m)
    return np.hypot(*(mosaic.centre_m - middle).T) < _TARGET * mosaic.body.edge.size_m


def _fine(body: Body, electrodes: Electrodes) -> SkinMesh:
    return skin_of(body, electrodes, _FIRST_S).image_mesh(6 * RINGS**2 * _FINER)


def _places(points: Array, mosaic: Pixels) -> Indices:
    """The pixel (...) of each point (..., 2); the nearest for points between the last ring's chords and the rim."""
    corners = mosaic.nodes_m[mosaic.triangles]
    nearest = KDTree(mosaic.centre_m).query(points, k=6)[1]
    edge = np.roll(corners, -1, axis=1) - corners
    away = points[..., None, None, :] - corners[nearest]
    left = edge[nearest][..., 0] * away[..., 1] - edge[nearest][..., 1] * away[..., 0]
    best = np.argmax(left.min(axis=-1), axis=-1)
    return np.take_along_axis(nearest, best[..., None], axis=-1)[..., 0]


def _ends(mesh: SkinMesh, potential: Array) -> Array:
    """Impedance matrix (N, N), Ohm, by the potentials."""
    return centred(mesh, potential)[len(mesh.nodes_m):]


def _uniform(mesh: SkinMesh, electrodes: Electrodes, drive: Drive, channels: Channels,
             conductance_S: float) -> tuple[Array, Array, Array]:
    """Potentials, readings (readings,), V, and their derivatives by the resistance of a square, A."""
    potential = potentials(mesh, np.full(len(mesh.cells), conductance_S), contact_impedances(present(electrodes)))
    ends = _ends(mesh, potential)
    sheet = np.broadcast_to(conductance_S**2 * np.eye(2), (*quadrature_points(mesh).shape[:2], 2, 2))
    slope = _by(drive, electrodes, channels, ends, -impedance_by_field(mesh, potential, sheet)[None])[:, 0]
    asked = protocol(drive, electrodes.count)
    return potential, channel_readings(asked, channels, among_all(electrodes, ends)).ravel(), slope


def _by(drive: Drive, electrodes: Electrodes, channels: Channels, impedance_Ohm: Array, impedance_by: Array) -> Array:
    """Derivatives of the readings (readings, p); 0 where an electrode without contact is needed."""
    asked, whole = protocol(drive, electrodes.count), among_all(electrodes, impedance_Ohm)
    changes = channel_changes(asked, channels, whole, whole, among_all(electrodes, impedance_by))
    return np.nan_to_num(changes.reshape(len(impedance_by), -1).T)


def _solved(prior: str, untouched: Untouched, columns: Array) -> Array:
    """R^-1 applied to columns (t, n)."""
    if prior == "noser":
        return columns / np.linalg.norm(untouched.jacobian_V, axis=0)[:, None]
    laplacian = _laplacian(untouched.pixels)
    laplacian[np.diag_indices_from(laplacian)] += _CONSTANT * np.trace(laplacian) / len(laplacian)
    return cho_solve(cho_factor(laplacian), columns)


def _laplacian(mosaic: Pixels) -> Array:
    """sum over inner edges of length over distance of the centroids, times the squared difference, as a matrix."""
    owners: dict[tuple[int, int], list[int]] = {}
    for t, corners in enumerate(mosaic.triangles.tolist()):
        for i in range(3):
            a, b = sorted((corners[i], corners[i - 1]))
            owners.setdefault((a, b), []).append(t)
    out = np.zeros((len(mosaic.triangles),) * 2)
    for (a, b), both in owners.items():
        if len(both) == 2:
            length = np.hypot(*(mosaic.nodes_m[a] - mosaic.nodes_m[b]))
            weight = length / np.hypot(*(mosaic.centre_m[both[0]] - mosaic.centre_m[both[1]]))
            out[np.ix_(both, both)] += weight * np.array([[1, -1], [-1, 1]])
    return out


def _noise_figure(matrix: Array, target_V: Array, area_m2: Array) -> float:
    """SNR of the readings over SNR of the image of a target's readings, white noise of any size on each reading."""
    weighted = matrix * area_m2[:, None]
    noise = np.sqrt(np.mean(np.sum(weighted**2, axis=1)))
    return float(np.mean(np.abs(target_V[target_V != 0])) / (np.mean(np.abs(weighted @ target_V)) / noise))
