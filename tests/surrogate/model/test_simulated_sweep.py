from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run.sweep import sweep
from surrogate.data.samples import read_samples
from surrogate.forward_map import rim_zone
from surrogate.model.evaluate import evaluate
from surrogate.model.train import train
from touchcal.json_file import write_json

TABLE_1 = {"schema": 1, "name": "Table 1",
           "hyperfoam": {"mu_Pa": [14420.0, 16780.0, -21670.0], "alpha": [0.288, 4.249, 0.741], "nu": [0.0, 0.0, 0.0],
                         "moduli": "instantaneous"},
           "conductivity": {"c0_S_per_m": 30.0, "a": [-2.0, 2.0, -1.0], "strain_range": [0.0, 0.4]}}


PUNCH = {"x_mm": [-40, 40], "y_mm": [-40, 40], "diameter_mm": [10, 18], "force_N": [0.1, 2.0]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hundred simulated scenes, and their card."""
    made = tmp_path_factory.mktemp("simulated")
    write_json(TABLE_1, made / "card.json")
    sweep(design_from({"scenes": 100, "seed": 5, "punch": PUNCH}), made / "card.json", made / "sweep")
    return made


@pytest.mark.slow
def test_a_hundred_simulated_scenes_teach_the_forward_map(folder: Path) -> None:
    samples = read_samples(folder / "sweep")
    found = evaluate(train(samples, "forward", seed=1), samples)
    scores = found.scores["outputs"]
    rmse = {name: parts["test"]["rmse"] for name, parts in scores.items()}
    table = found.predictions[found.predictions.part == "test"]
    place = table[table.output.isin(["x0", "y0"])]
    # farther out the rim adds to signals, which some twenty scenes do not teach
    radius = place.groupby("scene").target.transform(lambda mm: np.hypot(*mm))
    off = (place.value - place.target)[radius < rim_zone.DISC.learned[1] * samples.ring.radius_mm]
    print("test RMSE of 70 training scenes:", rmse, "of places in the interior:", np.sqrt(np.mean(off**2)))
    assert len(off) >= 20
    assert np.sqrt(np.mean(off**2)) < 0.02
    assert max(rmse["x0"], rmse["y0"]) < 0.05
    assert all(parts["test"]["r2"] > 0.9 for parts in scores.values())


@pytest.mark.slow
def test_forces_of_spheres_are_seldom_far_outside_their_intervals(folder: Path) -> None:
    """At 80 dB, of spheres not seen before: farther from the truth than the width of the interval, and no flag."""
    design = design_from({"scenes": 40, "seed": 77, "punch": PUNCH | {"force_N": [0.2, 1.8], "profile": "sphere"}})
    samples, rows = read_samples(folder / "sweep"), sweep(design, folder / "card.json", folder / "spheres").ok
    base = samples.baseline_V[0]
    noise_V = 1e-4 * float(np.sqrt(np.mean(base**2)))
    frames = base + rows.filter(regex="^dv_").to_numpy(float)
    frames += noise_V * np.random.default_rng(3).normal(size=frames.shape)
    shares = []
    for others in (samples.others, ()):
        found = train(replace(samples, others=others), "forward", seed=1).predict(frames, base, noise_V=noise_V)
        far = (found["F_N"] - rows["F_N"].to_numpy()).abs() > found["F_hi90_N"] - found["F_lo90_N"]
        shares.append(float(np.mean(far & (found["flag"] == ""))))
    print("silently wrong with other profiles and without:", shares)
    assert shares[0] <= 0.05
    assert shares[1] > shares[0]
