"""The least root mean square error that any estimator can have over a data set's touches, by noise level.

Best errors are averages over the set's prior: touches uniform where the punch fits, diameters and forces uniform over
their ranges. White noise is added to the touched frame alone, as in `evaluate`; where both frames are noisy and of
equal averaging, the change has sqrt(2) times the noise of one.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from eitsim.scene.scene import Scene
from eitsim.sweeps.dataset.parquet import read_manifest
from eitsim.sweeps.design.design import design_from, flat_scene
from eitsim.sweeps.measurement.instrument import below
from matcal.card import read_card
from surrogate.bounds.derivative_table import SlopeTable, derivatives_at, table_for
from surrogate.bounds.fisher_information import Prior, information, split
from surrogate.bounds.material_spread import MaterialSpread, known_material, spread_of
from surrogate.bounds.reading_derivatives import slopes_of
from surrogate.bounds.van_trees import Domain, domain, least_error
from surrogate.data import outputs
from surrogate.data.samples import SweepSamples, content_hash, read_samples, take
from surrogate.forward_map.inversion import mechanical_response
from surrogate.statistics.gaussian_process import spread_evenly
from surrogate.statistics.metrics import rms
from touchcal.arrays import Array

Gradient = Callable[[Array], Array]  # targets' derivatives (n, 2) by d and F at touches (n, 2)

# Rows that the responses' derivatives are learned from, and the step of their differences, relative.
_ROWS, _STEP = 400, 1e-3


@dataclass(frozen=True)
class Floor:
    """Least root mean square errors at one noise level."""

    dataset: str  # sha256 of the data set's rows and their signals
    noise_db: float  # dB below the RMS of the baseline voltages
    noise_V: float  # noise of one reading, V
    known: Mapping[str, float]  # by output, in its unit; a known material
    # the same where the material is known to its posterior; x0, y0, d and F alone; empty without one
    material: Mapping[str, float] = field(default_factory=dict)


def floors(folder: Path | str, card_path: Path, noise_db: Sequence[float], *, material: bool = False,
           each: Callable[[Iterable[int]], Iterable[int]] = iter) -> list[Floor]:
    """Floors of a data set's outputs at noise levels in dB below the RMS of its baseline voltages.

    card_path: the card that it was swept with, and with material=True its posterior. ValueError where its scenes have
    no derivatives (a conducting punch, friction, a hold, a skin with an outline).
    """
    samples, card = read_samples(folder), read_card(card_path)
    if samples.ring.sheet is not None:
        raise ValueError(f"{folder}: limits over a data set are taken from few places and the turns of a disc, and its "
                         "skin has an outline. Give `scene` FILE for the limit at a touch, with `map` all over the "
                         "skin; evaluate without a card.")
    prior = prior_of(samples)
    table = table_for(example_of(folder), card, prior, each=each)
    gradients = _gradients(samples)
    spread = spread_of(card, card_path) if material else None
    dataset, found = content_hash(samples), []
    for level in noise_db:
        noise_V = below(level, rms(samples.baseline_V))
        known = least_rms(table, prior, noise_V, known_material(), gradients)
        open_ = {} if spread is None else least_rms(table, prior, noise_V, spread)
        found.append(Floor(dataset, level, noise_V, known, open_))
    return found


def prior_of(samples: SweepSamples) -> Prior:
    """The prior of rows: uniform over their ranges of diameter and force, and where the outermost one still fits."""
    x, y, d, force = samples.target[:, :outputs.TOUCH].T
    radius = samples.ring.radius_mm
    gap = max(float(np.min(radius - np.hypot(x, y) - d / 2)), 0.0)
    ends = [(float(values.min()), float(values.max())) for values in (d, force)]
    return Prior(radius, gap, ends[0], ends[1])


def example_of(folder: Path | str) -> Scene:
    """A scene of the design of a data set."""
    design = read_manifest(Path(folder))["design"]
    return flat_scene(design_from({"scenes": 1, "seed": design["seed"], **design["tables"]}))


def least_rms(table: SlopeTable, prior: Prior, noise_V: float, spread: MaterialSpread,
              gradients: Mapping[str, Gradient] | None = None) -> dict[str, float]:
    """Least root mean square error of x0, y0 (the same, by the ring's symmetry), d and F, and of other targets by their
    gradients."""
    where = domain(prior.d_mm, prior.force_N)
    each = [_at_place(table, where, k, noise_V, spread, gradients or {}) for k in range(len(table.weight))]
    mean = {name: float(table.weight @ [one[name] for one in each]) for name in each[0]}
    return {name: float(np.sqrt(value)) for name, value in mean.items()}


def _at_place(table: SlopeTable, where: Domain, place: int, noise_V: float, spread: MaterialSpread,
              gradients: Mapping[str, Gradient]) -> dict[str, float]:
    """Mean squared errors at one of the table's places."""
    points = where.points
    touch = points.reshape(-1, 2)
    found = slopes_of(derivatives_at(table, place, touch[:, 0], touch[:, 1]), spread)
    parts = split(information(found, noise_V))
    punch = parts.punch.reshape(*points.shape, 2)

    def error(slope: Array) -> float:
        return where.mean(least_error(where, punch, slope.reshape(points.shape)))

    by_place = [error(-parts.follows[:, k]) + where.mean(parts.place[:, k, k].reshape(points.shape[:-1]))
                for k in range(2)]
    axes = {name: np.broadcast_to(np.eye(2)[k], touch.shape) for k, name in enumerate(("d", "F"))}
    varying = {name: slope for k, (name, slope) in enumerate(axes.items()) if k in where.varies}
    others = {name: gradient(touch) for name, gradient in gradients.items()}
    return (dict.fromkeys(("x0", "y0"), sum(by_place) / 2) | dict.fromkeys(axes, 0.0)
            | {name: error(slope) for name, slope in (varying | others).items()})


def _gradients(samples: SweepSamples) -> dict[str, Gradient]:
    """Derivatives of the mechanical outputs by d and F, of processes learned from some of the rows."""
    some = take(samples, spread_evenly(len(samples), _ROWS))
    names, touch = samples.names[outputs.TOUCH:], some.target[:, :outputs.TOUCH]
    learned = mechanical_response.fit(some.ring, touch, some.target[:, outputs.TOUCH:], names,
                                      np.zeros((len(touch), 0)))

    def value(punch: Array) -> Array:
        touches = np.column_stack([0 * punch, punch])
        return mechanical_response.respond(learned, some.ring, touches, np.zeros((len(punch), 0))).value

    def slopes(punch: Array) -> Array:
        steps = [_STEP * punch * np.eye(2)[k] for k in range(2)]
        return np.stack([(value(punch + step) - value(punch - step)) / (2 * step[:, k, None])
                         for k, step in enumerate(steps)], axis=-1)

    def of(k: int) -> Gradient:
        return lambda punch: slopes(punch)[:, k]

    return {name: of(k) for k, name in enumerate(names)}
