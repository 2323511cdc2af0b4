"""Errors of two touches read from one frame, the simulator's readings of both under white noise, by the gap between.

Run as `python benchmarks/two_touches.py MODEL_DIR DATA_SET CARD`; writes results/two_touches.csv next to this file. Two
punches of one diameter, 14 mm, under 1.2 and 0.8 N, about a point at most 10 mm from the centre in x and in y; a single
touch next to them, without a gap and without errors, tells whether one is taken for two.
"""

import sys
from pathlib import Path

import numpy as np
from conditions import quick, shown, written

from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.forward_map.scattering import unit_V
from surrogate.learners.forward import TouchInversion
from surrogate.model.model import load_of_sweep
from surrogate.single_frame.several_at_once import number, read_several
from surrogate.single_frame.simulator_likelihood import simulator_of, solved

GAPS_MM, NOISES_V = quick((5.0, 10.0, 20.0, 30.0, 45.0, 60.0), (20.0, 45.0)), (2e-5, 2e-4)


def main() -> None:
    if len(sys.argv) != 4:
        raise SystemExit("two_touches.py: give a forward model, its data set and its card.")
    model, rng = load_of_sweep(Path(sys.argv[1])), np.random.default_rng(0)
    if not isinstance(model.learner, TouchInversion):
        raise SystemExit(f"two_touches.py: {sys.argv[1]} is of method {model.method}; give one of method forward.")
    forward = model.learner.forward
    simulator = simulator_of(Path(sys.argv[3]), data=Path(sys.argv[2]))
    rows = []
    for gap in (np.nan, *GAPS_MM):
        angle, apart = rng.uniform(0, np.pi), 0.0 if np.isnan(gap) else gap + 14.0
        half = apart / 2 * np.array([np.cos(angle), np.sin(angle)])
        touches = np.array([[*-half, 14.0, 1.2], [*half, 14.0, 0.8]])[:1 if np.isnan(gap) else 2]
        touches[:, :2] += rng.uniform(-10, 10, 2)
        touches = touches[np.argsort(touches[:, 0])]
        clean = solved(simulator, touches).signal_V
        for noise in NOISES_V:
            frame = clean + noise * rng.normal(size=clean.size)
            alone = to_unknown(invert(forward, frame[None], noise).touch, forward.p0)[0]
            each = read_several(forward, frame, noise, alone, 2, unit_V(forward.ring, model.baseline_V))
            one, found = each
            off = found.touch - touches if len(touches) == 2 else np.full((2, 4), np.nan)
            rows.append({"gap_mm": gap, "noise_V": noise, "two": number(each) == 2, "too_near": found.too_near,
                         "place_1_mm": np.hypot(*off[0, :2]), "place_2_mm": np.hypot(*off[-1, :2]),
                         "F_1_N": off[0, 3], "F_2_N": off[-1, 3], "gain": one.score - found.score,
                         "misfit": found.misfit, "misfit_of_one": one.misfit})
    shown(written(rows, "two_touches"))


if __name__ == "__main__":
    main()
