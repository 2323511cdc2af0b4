"""True error of dV, its estimate and CPU time of the electrics at default settings over random touches.

SCENES touches of Table 1 anywhere on the disc: 8 to 20 mm, forces log-uniform from 0.01 N to 0.4 mu_0 pi d^2. dV is
compared with two solutions on a mesh of another family with ten times the unknowns or more: biquadratic rings
that are circles of Apollonius between the contact and the rim (images of concentric circles by a conformal map of the
disc to itself), graded geometrically at the ends of the electrodes. For one touch in ten a still finer one tells what
that reference itself is off. Touches that are axisymmetric are also solved on the mesh. Run by `make bench`, which pins
threads; --scenes shortens it; a run continues where results/electrics_random.csv ends.
"""

import argparse
import csv
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import CONDITIONS, RESULTS, conditions, quick
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.cem.assembly import SkinMesh, dissection, impedance, quadrature_points
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.mesh.ring_mesh import centred_radii, inside_rim, ring_mesh
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.drive import Drive, read_out
from eitsim.scene.electrodes import Electrodes, arcs
from eitsim.scene.results import Touch
from eitsim.scene.scene import Accuracy, Body, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import touched_conductance, untouched_conductance
from eitsim.simulation.near_edges import solve_near_rim
from eitsim.simulation.routes.route import Case

BODY, SKIN, ELECTRODES, DRIVE = Body(), Skin(), Electrodes(), Drive()
SCENES, SEED = quick(200, 3), 5
# part of [accuracy] signal that is the electrics'
SHARE = 0.2
COLUMNS = ("scene", "d_mm", "F_N", "gap_mm", "rim", "method", "unknowns", "cpu_ms", "estimate", "dv_error",
           "reference_unknowns", "reference_error", *CONDITIONS)


@dataclass(frozen=True)
class Fineness:
    """Of the reference: divisor of all widths, sectors at least, and edges under an electrode and between two."""

    level: int
    sectors: int = 48
    edges: int = 8


# gap below which the reference takes its finest mesh
SLIM_M, FINEST = 3e-4, Fineness(6, 64, 10)


def punch_of(k: int) -> Punch:
    """Punch k, drawn from the seed (SEED, k) alone."""
    rng = np.random.default_rng([SEED, k])
    diameter = rng.uniform(0.008, 0.02)
    force = np.exp(rng.uniform(np.log(0.01), np.log(0.4 * TABLE_1.mu_0_Pa * np.pi * diameter**2)))
    away, angle = (BODY.radius_m - diameter / 2) * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    return Punch(away * math.cos(angle), away * math.sin(angle), diameter, float(force))


def circles_of_apollonius(centre: float, radius: float) -> tuple[float, float]:
    """a, q: w -> (w + a)/(1 + a w) takes |w| = q to the circle about `centre` >= 0 in the unit disc."""
    if centre < 1e-9:
        return 0.0, radius
    first, last = centre - radius, centre + radius
    mean = 1 + first * last
    a = (mean - math.sqrt(mean**2 - (first + last)**2)) / (first + last)
    return a, (last - a) / (1 - a * last)


def geometric(edges: int, least: float) -> np.ndarray:
    """Points in [0, 1), from both ends on wider by one ratio, the first edge `least` long."""
    half, low, high = edges // 2, 1.0001, 50.0
    for _ in range(80):
        ratio = math.sqrt(low * high)
        low, high = (ratio, high) if least * (ratio**half - 1) / (ratio - 1) < 0.5 else (low, ratio)
    x = low ** np.arange(half + 1) - 1
    return np.concatenate([x / x[-1] / 2, 1 - x[-2::-1] / x[-1] / 2])[:-1]


def on_rim(mapped: Callable[[np.ndarray], np.ndarray], fineness: Fineness) -> tuple[np.ndarray, np.ndarray]:
    """Angles of nodes and the electrode that follows each, halved where their images are further apart than a sector.
    """
    ends, least = arcs(BODY.radius_m, ELECTRODES), 2e-4 / BODY.radius_m
    after = np.append(ends[1:, 0], ends[0, 0] + 2 * np.pi)
    pieces = [(a, b, k) for k, (start, stop) in enumerate(ends) for a, b, k in ((start, stop, k), (stop, after[k], -1))]
    angle = np.concatenate([a + (b - a) * geometric(fineness.edges, least / (b - a)) for a, b, _ in pieces])
    electrode = np.repeat([k for *_, k in pieces], fineness.edges)
    while True:
        following = np.append(angle[1:], angle[0] + 2 * np.pi)
        wide = np.flatnonzero(np.abs(np.angle(mapped(following) / mapped(angle))) > 2 * np.pi / fineness.sectors)
        if not len(wide):
            return angle, electrode
        angle = np.insert(angle, wide + 1, (angle[wide] + following[wide]) / 2)
        electrode = np.insert(electrode, wide + 1, electrode[wide])


def spread(length: float, width: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Points of [0, length], spaced in proportion to a width and at most as wide."""
    x = np.linspace(0, length, 2049)
    steps = np.concatenate([[0.0], np.cumsum(np.diff(x) / width((x[1:] + x[:-1]) / 2))])
    return np.interp(np.linspace(0, steps[-1], math.ceil(steps[-1]) + 1), steps, x)


def with_middles(values: np.ndarray) -> np.ndarray:
    return np.sort(np.concatenate([values, (values[1:] + values[:-1]) / 2]))


def reference_mesh(punch: Punch, touch: Touch, fineness: Fineness) -> SkinMesh:
    """Rings about the punch up to the end of contact, from there to the rim along circles of Apollonius."""
    touch, gap = inside_rim(punch, touch, np.array([BODY.radius_m]))
    inner = centred_radii(punch, touch, gap, fineness.level - 1, 1, 0.1)
    inner = inner[inner <= max(punch.diameter_m / 2, touch.contact_radius_m) * (1 + 1e-12)]
    place = complex(punch.x_m, punch.y_m)
    turn, centre, radius = np.angle(place), abs(place) / BODY.radius_m, inner[-1] / BODY.radius_m
    a, q = circles_of_apollonius(centre, radius)

    def mapped(angle: np.ndarray) -> np.ndarray:
        z = np.exp(1j * (angle - turn))
        return (z - a) / (1 - a * z)

    angle, electrode = on_rim(mapped, fineness)
    middle = (angle + np.append(angle[1:], angle[0] + 2 * np.pi)) / 2
    first, last = (inner[-1] - inner[-2]) / inner[-1], 2e-4 / BODY.radius_m * (1 - a) / (1 + a)
    way = -math.log(q)
    steps = spread(way, lambda x: np.minimum(np.minimum(0.7 * first + 0.35 * x, 0.25), 1.5 * last + 0.3 * (way - x))
                   * 2 / fineness.level)
    outer = with_middles(q * np.exp(steps))
    outer[-1] = 1.0
    w = outer[:, None] * mapped(np.column_stack([angle, middle]).ravel())
    z = (w + a) / (1 + a * w)
    inside = centre + (with_middles(inner)[1:-1, None] / inner[-1]) * (z[0] - centre)
    nodes = np.append(centre, np.vstack([inside, z]).ravel()) * np.exp(1j * turn) * BODY.radius_m
    rings = len(inner) + len(steps) - 2
    plain = ring_mesh(np.linspace(0, 1, rings + 1), np.zeros((rings + 1, 2)), angle, electrode, ELECTRODES.count)
    return replace(plain, nodes_m=np.column_stack([nodes.real, nodes.imag]))


def signal_on(mesh: SkinMesh, punch: Punch, touch: Touch) -> np.ndarray:
    """dV from two solutions on one mesh."""
    z, order = ELECTRODES.contact_impedance_Ohm_m, dissection(mesh)
    touched = touched_conductance(quadrature_points(mesh), ((punch, touch),), SKIN, SKIN_LAW)
    untouched = np.full(len(mesh.cells), untouched_conductance(SKIN_LAW, SKIN))
    first, second = (impedance(mesh, s, z, order=order) for s in (touched, untouched))
    return read_out(DRIVE, first - second)


def distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def rows(k: int) -> list[dict[str, object]]:
    punch = punch_of(k)
    rim = Case(Scene(punches=(punch,))).near
    touch = (solve_near_rim if rim else solve_touch)(TABLE_1, BODY, punch)
    gap = BODY.radius_m - math.hypot(punch.x_m, punch.y_m) - punch.diameter_m / 2
    mesh = reference_mesh(punch, touch, FINEST if gap < SLIM_M else Fineness(3 if rim else 6))
    exact, off = signal_on(mesh, punch, touch), np.nan
    if k % 10 == 5:
        off = distance(exact, signal_on(reference_mesh(punch, touch, FINEST), punch, touch))
    out = []
    for method in ("auto",) if rim else ("auto", "mesh"):
        got = solve(BODY, SKIN, ELECTRODES, DRIVE, ((punch, touch),), SKIN_LAW, signal=SHARE * Accuracy().signal,
                    method=method)
        out.append({"scene": k, "d_mm": punch.diameter_m * 1e3, "F_N": punch.force_N, "gap_mm": gap * 1e3, "rim": rim,
                    "method": f"{got.method}{' by choice' if method == 'mesh' else ''}", "unknowns": got.unknowns,
                    "cpu_ms": got.cpu_s * 1e3, "estimate": got.signal_error,
                    "dv_error": distance(got.signal_V, exact), "reference_unknowns": len(mesh.nodes_m),
                    "reference_error": off})
    return out


def summary(table: pd.DataFrame) -> str:
    """Quantiles of the true error, share of estimates within a factor of 3, and CPU time, by method and gap."""
    def line(group: pd.DataFrame) -> pd.Series:
        ratio = group["estimate"] / group["dv_error"]
        return pd.Series({"touches": len(group), **{f"dv_error {q:g}": group["dv_error"].quantile(q)
                                                    for q in (0.5, 0.9, 0.95, 1.0)},
                          "within 3": ratio.between(1 / 3, 3).mean(), "not below a third": (ratio >= 1 / 3).mean(),
                          "cpu_ms median": group["cpu_ms"].median(), "cpu_ms 0.95": group["cpu_ms"].quantile(0.95)})

    asked = pd.DataFrame(table.loc[~table["method"].str.contains("choice")])
    gap = pd.cut(table["gap_mm"], [0, 1, 5, 15, 43, 100])
    by = table.groupby(["method", gap], observed=True)[table.columns.tolist()].apply(line)
    parts = [by, line(asked).to_frame("all, as chosen").T]
    off = table["reference_error"].dropna()
    return "\n\n".join([*(part.to_string(float_format=lambda v: f"{v:.3g}") for part in parts),
                        f"reference against a finer one: median {off.median():.2g}, largest {off.max():.2g}"])


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--scenes", type=int, default=SCENES)
    options.add_argument("--out", type=Path, default=RESULTS / "electrics_random.csv")
    given = options.parse_args()
    done = set(pd.read_csv(given.out)["scene"]) if given.out.exists() else set()
    given.out.parent.mkdir(exist_ok=True, parents=True)
    with given.out.open("a", newline="") as file:
        writer = csv.writer(file)
        if not done:
            writer.writerow(COLUMNS)
        for k in set(range(given.scenes)) - done:
            for row in (one | conditions() for one in rows(k)):
                writer.writerow([f"{row[key]:.4g}" if isinstance(row[key], float) else row[key] for key in COLUMNS])
            file.flush()
    print(summary(pd.read_csv(given.out)))


if __name__ == "__main__":
    main()
