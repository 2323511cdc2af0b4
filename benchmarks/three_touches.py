"""Three touches counted and read from one frame, two diameters from each other, at 80 dB below the untouched readings.

Run as `python benchmarks/three_touches.py MODEL_DIR DATA_SET CARD`; writes results/three_touches.csv next to this file.
Punches of 14 mm under 0.5 to 1.5 N, within 44 mm of the centre, the nearest two at most a fifth farther than two
diameters from each other, centre to centre. The strains of single solutions are added, and the conductor is solved for
all; what the foam under one changes of the next is left out.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from conditions import quick, shown, written
from scipy.optimize import linear_sum_assignment

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.simulation.material import material_of
from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.forward_map.scattering import unit_V
from surrogate.learners.forward import TouchInversion
from surrogate.model.model import load_of_sweep
from surrogate.single_frame.several_at_once import number, read_several
from surrogate.single_frame.simulator_likelihood import Simulator, scene_at, simulator_of

COUNT, D_MM, REACH_MM = 3, 14.0, 44.0
DRAWS, SEEDS = quick((30, (5, 11)), (2, (5,)))
NORMAL_90 = 1.645


def touches(rng: np.random.Generator) -> np.ndarray:
    """(COUNT, 4) a draw of x, y, d, F."""
    while True:
        place = rng.uniform(-REACH_MM, REACH_MM, (COUNT, 2))
        between = np.linalg.norm(place[:, None] - place, axis=2)[np.triu_indices(COUNT, 1)].min()
        if (np.linalg.norm(place, axis=1) < REACH_MM).all() and 2 * D_MM <= between < 2.4 * D_MM:
            return np.column_stack([place, np.full(COUNT, D_MM), rng.uniform(0.5, 1.5, COUNT)])


def signal_V(simulator: Simulator, touch: np.ndarray) -> np.ndarray:
    """(readings,) of touches whose strains add up."""
    scene, material = scene_at(simulator, touch), material_of(simulator.scene, simulator.card)
    solved = tuple((punch, solve_touch(material.law, scene.body, punch)) for punch in scene.punches)
    return solve(scene.body, scene.skin, scene.electrodes, scene.drive, solved, material.skin).signal_V.ravel()


def main() -> None:
    if len(sys.argv) != 4:
        raise SystemExit("three_touches.py: give a forward model, its data set and its card.")
    model = load_of_sweep(Path(sys.argv[1]))
    if not isinstance(model.learner, TouchInversion):
        raise SystemExit(f"three_touches.py: {sys.argv[1]} is of method {model.method}; give one of method forward.")
    forward, simulator = model.learner.forward, simulator_of(Path(sys.argv[3]), data=Path(sys.argv[2]))
    simulator = replace(simulator, scene=replace(simulator.scene, punches=simulator.scene.punches[:1]))
    noise_V, one_V = 1e-4 * float(np.sqrt(np.mean(model.baseline_V**2))), unit_V(forward.ring, model.baseline_V)
    rows = []
    for seed in SEEDS:
        rng, right, off, held = np.random.default_rng(seed), [], [], []
        for _ in range(DRAWS):
            touch = touches(rng)
            frame = signal_V(simulator, touch)
            frame += noise_V * rng.normal(size=frame.size)
            alone = to_unknown(invert(forward, frame[None], noise_V).touch, forward.p0)[0]
            each = read_several(forward, frame, noise_V, alone, COUNT + 1, one_V)
            right.append(number(each) == COUNT)
            found = each[COUNT - 1]
            own, its = linear_sum_assignment(np.linalg.norm(touch[:, None, :2] - found.touch[:, :2], axis=2))
            error = found.touch[its] - touch[own]
            off.append(np.column_stack([np.linalg.norm(error[:, :2], axis=1), np.abs(error[:, 3]) / touch[own, 3]]))
            held.append(np.abs(error) < NORMAL_90 * np.sqrt(np.diag(found.covariance)).reshape(-1, 4)[its])
        place, force = np.concatenate(off).T
        rows.append({"seed": seed, "draws": DRAWS, "count_right": np.mean(right), "place_mm": place.mean(),
                     "place_90_mm": np.quantile(place, 0.9), "force_part": force.mean()}
                    | dict(zip(("in_x", "in_y", "in_d", "in_F"), np.concatenate(held).mean(axis=0), strict=True)))
    shown(written(rows, "three_touches"))


if __name__ == "__main__":
    main()
