"""Errors of the inversion on unseen touches, any diameter allowed, over the least that white noise allows.

The floor's prior has diameters even over their range. Where the touches have a few, such as the paper's five, which
alone have 1.22 times that standard deviation, their mean squares are weighed by the trapezoidal rule over the range.

Three floors of the same noise, root mean squares of x0, y0, d and F. `prior`: the least error of any estimator over the
data set's prior, by the simulator's derivatives and Van Trees' inequality (`surrogate limit --data`; within 80 mm its
places are weighed anew by a cubic in the square of the distance from the centre). `rows`: Cramer-Rao variances at the
scored touches by the simulator's derivatives there, which leave out what the rim changes of the mechanics, with a
Gaussian prior of the data set's variances. `map`: the same by the learned map's own derivatives. The first bounds
what anyone can do; the others are exact where readings are linear in the touch within its deviation, which (d, F) at
60 dB is not. Run as `python benchmarks/inversion_limit.py MODEL_DIR DATA_SET CARD`, MODEL_DIR of method forward, CARD
the one of DATA_SET; rows that the model was made from are left out. Writes results/inversion_limit.csv. The table of
the prior is kept between runs (TOUCHCAL_CACHE).
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from conditions import quick, shown, written
from numpy.typing import NDArray

from eitsim.scene.scene import Scene
from eitsim.sweeps.measurement.instrument import below
from matcal.card import MaterialCard, read_card
from surrogate.bounds.dataset_bound import example_of, least_rms, prior_of
from surrogate.bounds.derivative_table import Nodes, SlopeTable, table_for
from surrogate.bounds.fisher_information import Prior, information
from surrogate.bounds.material_spread import known_material
from surrogate.bounds.reading_derivatives import derivatives_of, slopes_of
from surrogate.data.samples import PARTS, read_samples
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.load_coordinates import MOST
from surrogate.learners.forward import TouchInversion
from surrogate.model.model import load_of_sweep
from surrogate.statistics.metrics import rms
from touchcal.arrays import Array

NAMES, LEVELS_DB, REACH_MM = ("x0", "y0", "d", "F"), (80.0, 60.0), 80.0
# Test rows that are inverted, and those of them whose derivatives are solved.
ROWS, SOLVED = quick((600, 24), (40, 4))
NODES = quick(Nodes(), Nodes(2, 1, 2))


@dataclass(frozen=True, eq=False)
class Region:
    """Part of the disc."""

    name: str
    # (n,) which touches lie there
    rows: NDArray[np.bool_]
    # the prior's table with the weights of its places there
    table: SlopeTable


def regions(touch: Array, table: SlopeTable, prior: Prior) -> list[Region]:
    """The whole disc, and within REACH_MM, which is all of a prior that reaches no further."""
    part = min((REACH_MM / float(prior.reach_mm(sum(prior.d_mm) / 2))) ** 2, 1.0)
    return [Region("disc", np.ones(len(touch), bool), table),
            Region(f"within {REACH_MM:g} mm", np.hypot(*touch[:, :2].T) <= REACH_MM,
                   replace(table, weight=weights(len(table.weight), part)))]


def weights(places: int, part: float) -> Array:
    """Weights of the table's places, Gauss-Legendre points on [0, 1], of the mean over [0, part] of the polynomial
    through them."""
    nodes = (1 + np.polynomial.legendre.leggauss(places)[0]) / 2
    powers = np.arange(places)
    return np.asarray(np.linalg.solve(nodes ** powers[:, None], part**powers / (powers + 1)), np.float64)


def solved(scene: Scene, card: MaterialCard, touch: Array, prior: Prior, noise_V: list[float]) -> Array:
    """(levels, n, 4) Cramer-Rao variances at touches (n, 4) by the simulator's derivatives."""
    out = np.empty((len(noise_V), len(touch), 4))
    for k, (x, y, d, force) in enumerate(touch.tolist()):
        punch = replace(scene.punches[0], x_m=x / 1e3, y_m=y / 1e3, diameter_m=d / 1e3, force_N=force, depth_m=None)
        slopes = slopes_of(derivatives_of(replace(scene, punches=(punch,)), card), known_material())
        out[:, k] = [local_variances(information(slopes, noise), prior) for noise in noise_V]
    return out


def local_variances(known: Array, prior: Prior) -> Array:
    """(4,) variances of the best estimate of (x, y, d, F) where readings of an information (4, 4) are linear in them,
    with a Gaussian prior of the prior's variances; 0 where the prior has none."""
    out, open_ = np.zeros(4), np.flatnonzero(prior.variances > 0)
    scale = np.sqrt(prior.variances[open_])
    scaled = known[np.ix_(open_, open_)] * np.outer(scale, scale) + np.eye(len(open_))
    out[open_] = np.diag(np.linalg.inv(scaled)) * scale**2
    return out


def rows(region: Region, level: float, squared: Array, variance: dict[str, Array], prior: dict[str, float],
         weight: Array) -> Iterator[dict[str, object]]:
    """One row an output: squared errors (n, 4), variances by the map (n, 4) and of the first touches by the simulator,
    and the least error over the prior, of touches of weights (n,)."""
    def over(squares: Array, k: int) -> float:
        kept = region.rows[:len(squares)]
        return root_mean(squares[kept, k], weight[:len(squares)][kept])

    for k, name in enumerate(NAMES):
        floor = {kind: over(one, k) for kind, one in variance.items()}
        told = {"rmse": over(squared, k)}
        of_solved = over(squared[:len(variance["rows"])], k)
        yield {"noise_db": level, "region": region.name, "rows": int(region.rows.sum()), "output": name, **told,
               "floor_prior": prior[name], "ratio_prior": told["rmse"] / prior[name],
               "floor_map": floor["map"], "ratio_map": told["rmse"] / floor["map"],
               "solved_rows": int(region.rows[:len(variance["rows"])].sum()), "rmse_solved": of_solved,
               "floor_rows": floor["rows"], "ratio_rows": of_solved / floor["rows"]}


def root_mean(squares: Array, weight: Array) -> float:
    """Root of the weighed mean."""
    return float(np.sqrt(np.average(squares, weights=weight)))


def even(d_mm: Array) -> Array:
    """(n,) weights that make of a mean over touches of a few diameters the mean over their range, by the trapezoidal
    rule; 1 where diameters are many."""
    values, which, counts = np.unique(d_mm, return_inverse=True, return_counts=True)
    if not 1 < len(values) <= MOST:
        return np.ones(len(d_mm))
    ends = np.concatenate([values[:1], (values[1:] + values[:-1]) / 2, values[-1:]])
    return (np.diff(ends) / counts)[which]


def inverted(forward: ForwardMap, signal: Array, touch: Array, noise_V: float) -> tuple[Array, Array]:
    """(n, 4) squared errors under noise, and the variances that the map's derivatives leave."""
    noisy = signal + noise_V * np.random.default_rng(0).normal(size=signal.shape)
    found = invert(forward, noisy, noise_V)
    return (found.touch - touch) ** 2, np.einsum("npp->np", found.peak.noise)


def main() -> None:
    if len(sys.argv) != 4:
        raise SystemExit("inversion_limit.py: give a forward model, a data set, and its card.")
    model, samples, card = load_of_sweep(Path(sys.argv[1])), read_samples(sys.argv[2]), read_card(Path(sys.argv[3]))
    if not isinstance(model.learner, TouchInversion):
        raise SystemExit(f"inversion_limit.py: {sys.argv[1]} is of method {model.method}; give one of method forward.")
    made_from = model.rows.row_hash[model.rows.part != PARTS.index("test")]
    some = np.flatnonzero(~np.isin(samples.row_hash, made_from))[:ROWS]
    signal, touch = samples.signal_V[some], samples.target[some, :4]
    prior, scene = prior_of(samples), example_of(sys.argv[2])
    noise_V = [below(level, rms(samples.baseline_V)) for level in LEVELS_DB]
    by_simulator = solved(scene, card, touch[:SOLVED], prior, noise_V)
    parts = regions(touch, table_for(scene, card, prior, NODES), prior)
    free, found = replace(model.learner.forward, known_mm=np.zeros(0)), []
    for level, noise, variance in zip(LEVELS_DB, noise_V, by_simulator, strict=True):
        squared, of_map = inverted(free, signal, touch, noise)
        for part in parts:
            least = least_rms(part.table, prior, noise, known_material())
            found += rows(part, level, squared, {"map": of_map, "rows": variance}, least, even(touch[:, 2]))
    shown(written(found, "inversion_limit"))


if __name__ == "__main__":
    main()
