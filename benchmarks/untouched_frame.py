"""What scaling by the untouched frame takes out: errors of a model on sensors that differ from the one it learned.

Usage: python benchmarks/untouched_frame.py MODEL CARD [TOUCHES]. Synthetic: touches by the simulator within 42 mm of
the middle, white noise at 80 dB, 20 untouched frames. Prints for each sensor, without and with scaling, the RMSE of x0,
y0 (mm), d (mm) and F (N), and the share of the 90 % intervals of F that hold.
"""

import sys
import warnings
from dataclasses import replace

import numpy as np

import eitsim
from eitsim.scene.electrodes import Electrodes
from surrogate.model.model import load_of_sweep

SKIN, NAMES = eitsim.Scene().skin, ("x0", "y0", "d", "F")


def scenes(count: int) -> list[eitsim.Scene]:
    """Touches of the trained kind."""
    rng = np.random.default_rng(31)
    radius, angle = 0.042 * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    return [eitsim.Scene(punches=(eitsim.Punch(r * np.cos(a), r * np.sin(a), d / 1e3, force),)) for r, a, d, force in
            zip(radius, angle, rng.choice([10, 12, 14, 16, 18], count), rng.uniform(0.1, 2.0, count), strict=True)]


def sensors() -> dict[str, dict[str, object]]:
    """What of a scene each sensor changes."""
    ring = Electrodes()
    return {"as learned": {}, "sheet 5 % thicker": {"skin": replace(SKIN, thickness_m=1.05 * SKIN.thickness_m)},
            "sheet 20 % thinner": {"skin": replace(SKIN, thickness_m=0.8 * SKIN.thickness_m)},
            "contact impedance doubled": {"electrodes": replace(
                ring, contact_impedance_Ohm_m=2 * np.asarray(ring.contact_impedance_Ohm_m))}}


def main(folder: str, card: str, touches: int = 40) -> None:
    """Print the table of a model."""
    model, rng = load_of_sweep(folder), np.random.default_rng(0)
    asked = scenes(touches)
    truth = np.array([[p.x_m, p.y_m, p.diameter_m, p.force_N] for scene in asked for p in scene.punches])
    noise = 1e-4 * float(np.sqrt(np.mean(model.baseline_V**2)))
    for name, change in sensors().items():
        found = [one for one in (eitsim.simulate(replace(scene, **change), card, reuse=True).readings
                                 for scene in asked) if one is not None]
        volts = np.array([one.touched_V.ravel() for one in found])
        rest = np.tile(found[0].baseline_V.ravel(), (20, 1))
        gains = {"": 1.0, ", gains 3 % apart": 1 + 0.03 * rng.normal(size=rest.shape[1])}
        for words, gain in gains.items():
            frames, untouched = (gain * (part + noise * rng.normal(size=part.shape)) for part in (volts, rest))
            for scaling in ("no", "auto"):
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    table = model.predict(frames, untouched, scale_baseline=scaling)
                off = table[["x0_m", "y0_m", "d_m", "F_N"]].to_numpy() - truth
                rmse = np.sqrt(np.mean(off**2, axis=0)) * [1e3, 1e3, 1e3, 1]
                held = np.mean((table["F_lo90_N"] <= truth[:, 3]) & (truth[:, 3] <= table["F_hi90_N"]))
                print(f"{name + words}, scaling {scaling}: " + ", ".join(
                    f"{one} {value:.3f}" for one, value in zip(NAMES, rmse, strict=True)) + f"; F held {held:.2f}")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2], *map(int, sys.argv[3:]))
