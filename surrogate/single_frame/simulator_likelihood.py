"""The simulator as a forward map: readings of a touch, their derivatives, and what is not known of them."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from eitsim.electrics.forward.untouched import untouched_readings
from eitsim.scene.scene import Scene, read_scene
from eitsim.sheet.sheet_conductance import untouched_conductance
from eitsim.simulation.material import material_of
from eitsim.simulation.simulate import solve_scene
from matcal.card import MaterialCard, read_card
from surrogate.bounds.dataset_bound import example_of
from surrogate.bounds.fisher_information import Slopes
from surrogate.bounds.material_spread import MaterialSpread, known_material, spread_of
from surrogate.bounds.reading_derivatives import derivatives_of, slopes_of
from surrogate.data.sensor_ring import Ring, ring_of, same_ring
from touchcal.arrays import Array
from touchcal.errors import NotConverged


@dataclass(frozen=True, eq=False)
class Simulator:
    """A sensor, its skin and kind of punch, its material and what is left open of that."""

    scene: Scene
    card: MaterialCard
    spread: MaterialSpread


@dataclass(frozen=True, eq=False)
class Solved:
    """Readings of one solved scene."""

    signal_V: Array  # (readings,) change by the touches, V
    baseline_V: Array  # (readings,) untouched, V
    # relative error of the signal, 2-norm, that solving left, and with the bounds of what the plan left out
    numerical: float
    error_estimate: float


@dataclass(frozen=True, eq=False)
class Unknowns:
    """What readings differ by from a forward map's: C = white_V^2 I + M M'."""

    white_V: float  # standard deviation of one reading, V
    columns: Array  # (readings, m) M, V

    @property
    def whitening(self) -> Array:
        """(readings, readings) W with W'W = C^-1, by the eigenvectors of M M' (M = U S V': shrunk along U)."""
        left, size, _ = np.linalg.svd(self.columns, full_matrices=False)
        shrunk = 1 / np.sqrt(1 + (size / self.white_V) ** 2)
        return (np.eye(len(left)) + (left * (shrunk - 1)) @ left.T) / self.white_V


def simulator_of(card_path: Path, *, data: Path | None = None, scene: Path | None = None) -> Simulator:
    """The simulator of a card and of a scene file or of the design of a data set; a card without a posterior is taken
    as exact. ValueError unless one of data and scene is given, or where the card's posterior cannot be used."""
    if (data is None) == (scene is None):
        raise ValueError("the simulator needs one sensor; give `data` DIR, the data set whose design tells it, or "
                         "`scene` FILE.")
    card = read_card(card_path)
    spread = spread_of(card, card_path) if card.posterior else known_material()
    made = example_of(data) if data is not None else read_scene(Path(str(scene)))
    if len(made.punches) != 1:
        raise ValueError(f"{data or scene}: {len(made.punches)} punches, and the kind of one is needed. Give one "
                         "[punch].")
    return Simulator(made, card, spread)


def check_sensor(simulator: Simulator, ring: Ring) -> None:
    """ValueError where the scene's readings are not those of a model."""
    # the foreseen modes aside
    if not same_ring(replace(ring_of(simulator.scene), modes=ring.modes), ring):
        raise ValueError("the scene's body, electrodes or drive are not those that the model was trained on. Give the "
                         "model's own data set with `data`, or a `scene` with its [body], [electrodes] and [drive].")


def untouched_of(simulator: Simulator) -> Array:
    """(readings,) of the untouched skin, V."""
    skin = material_of(simulator.scene, simulator.card).skin
    return untouched_readings(simulator.scene, untouched_conductance(skin, simulator.scene.skin))


def scene_at(simulator: Simulator, touches: Array) -> Scene:
    """The scene with punches (k, 4) at x, y, of d, mm, under F, N."""
    kind = simulator.scene.punches[0]
    punches = (replace(kind, x_m=x / 1e3, y_m=y / 1e3, diameter_m=d / 1e3, force_N=force, depth_m=None)
               for x, y, d, force in np.atleast_2d(touches).tolist())
    return replace(simulator.scene, punches=tuple(punches))


def solved(simulator: Simulator, touches: Array) -> Solved:
    """Readings of touches (4,) or (k, 4), electrodes no bodies, as in the sweep; NotConverged where they cannot be
    solved, with the simulator's words."""
    scene = scene_at(simulator, touches)
    found = solve_scene(scene, simulator.card, bodies=False)
    if found.outcome != "ok" or found.readings is None:
        raise NotConverged(f"the simulator has no readings of this touch ({found.outcome}): {found.message}",
                           estimate=np.asarray(touches))
    return Solved(found.readings.signal_V.ravel(), found.readings.baseline_V.ravel(),
                  float(found.numerical_error["signal"]), float(found.error_estimate["signal"]))


def slopes_at(simulator: Simulator, touch: Array) -> Slopes:
    """Derivatives at a touch (4,), without what the rim changes of the mechanics; NotConverged as `solved`."""
    return slopes_of(derivatives_of(scene_at(simulator, touch), simulator.card), simulator.spread)


def unknowns_of(solved_here: Solved, slopes: Slopes, noise_V: float) -> Unknowns:
    """Noise, material and the error that solving left, at one touch.

    Of that error eps |dV| nobody knows the pattern: it is counted once along dV itself, where it hides best, and once
    more spread evenly over all readings.
    """
    signal = solved_here.signal_V
    spread = solved_here.numerical * np.linalg.norm(signal) / np.sqrt(signal.size)
    along = solved_here.numerical * signal
    return Unknowns(float(np.hypot(noise_V, spread)), np.column_stack([slopes.material, along]))
