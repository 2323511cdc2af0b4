"""Answers that are wrong with no flag: kinds of frames by noise, read by a forward model.

Usage: silent_answers.py MODEL CARD FOLDER [SEED]. Simulates 40 touches of each kind with `eitsim sweep` in FOLDER once
(some CPU minutes), adds noise of 80 and 60 dB below the untouched readings' r.m.s., and reads them with 200 untouched
frames of the same noise. Wrong: x, y or F farther from the truth than twice the half width of its 90 % interval. Of two
touches the nearer one is the truth. Writes results/silent_answers.csv.
"""

import sys
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import quick, shown, written

import eitsim
import surrogate
from touchcal.arrays import Array

PLACE = "place = { within_mm = 45 }\n"
LIST = PLACE + "diameter_mm = { choice = [10, 12, 14, 16, 18] }\nforce_N = [0.1, 2.0]\n"
FORCE = PLACE + "force_N = [0.2, 1.8]\n"
PUNCHES = {"single": LIST, "two touches": "place = { within_mm = 45, apart_mm = 30 }\n"
           "diameter_mm = { choice = [10, 14, 18] }\nforce_N = [0.2, 1.5]\n",
           "between": FORCE + "diameter_mm = { choice = [11, 13, 15, 17] }\n",
           "larger": FORCE + "diameter_mm = { choice = [20, 22, 24, 26, 30] }\n",
           "smaller": FORCE + "diameter_mm = { choice = [7, 8] }\n",
           **{name: FORCE + f'profile = "{name}"\ndiameter_mm = [10, 18]\n'
              for name in ("sphere", "cone", "ellipse")}}
LIFTED = (1.05, 1.5, 5, 1000)
LEVELS, BASELINES, LASTS = (80, 60), 200, 20.0
Noise = Callable[[int], Array]


def simulated(folder: Path, card: str, count: int, seed: int) -> dict[str, pd.DataFrame]:
    """Solved touches of each kind."""
    found = {}
    for name, punch in {**PUNCHES, **{f"contact x{k:g}": LIST for k in LIFTED}}.items():
        top = f"scenes = {count}\nseed = {seed}\n" + ("touches = 2\n" if name == "two touches" else "")
        contact = [1.0] * 16
        contact[5] = float(name.partition(" x")[2] or 1)
        electrodes = f"[electrodes]\ncontact_impedance_Ohm_m = {contact}\n" if "contact" in name else ""
        design = folder / f"{name.replace(' ', '_')}_{seed}.toml"
        design.write_text(f"{top}[punch]\n{punch}{electrodes}", encoding="utf-8")
        found[name] = eitsim.sweep(design, card, out=design.with_suffix(""), workers=1).ok.reset_index(drop=True)
    return found


def noises(base: Array, sd: float, rng: np.random.Generator) -> dict[str, Noise]:
    """Draws of noise of one r.m.s."""
    n = len(base)
    root = np.linalg.cholesky(np.exp(-np.abs(np.subtract.outer(np.arange(n), np.arange(n))) / LASTS))
    return {"white": lambda k: sd * rng.normal(size=(k, n)),
            "pattern": lambda k: sd * np.sqrt(0.5) * (rng.normal(size=(k, n)) + np.repeat(
                rng.normal(size=(k, 16)), n // 16, axis=1)),
            "neighbours": lambda k: sd * rng.normal(size=(k, n)) @ root.T,
            "proportional": lambda k: sd * rng.normal(size=(k, n)) * np.abs(base) / np.sqrt(np.mean(base**2)),
            "heavy-tailed": lambda k: sd * rng.standard_t(2.5, size=(k, n)) / np.sqrt(5)}


def scored(model: surrogate.SweepModel, rows: pd.DataFrame, frames_V: Array, baseline_V: Array) -> Mapping[str, float]:
    """Coverage of unflagged frames, and shares that are flagged, and wrong with no flag."""
    found = model.predict(frames_V, baseline_V)
    nearer = np.zeros(len(rows), bool)
    if "x_2_mm" in rows:
        one, other = (np.hypot(found.x0_m * 1e3 - rows[f"x{k}_mm"], found.y0_m * 1e3 - rows[f"y{k}_mm"])
                      for k in ("", "_2"))
        nearer = (other < one).to_numpy()
    flagged, wrong, out = (found.flag != "").to_numpy(), {}, {}
    for name, column, unit, per in (("x0", "x", "mm", 1e3), ("y0", "y", "mm", 1e3), ("F", "F", "N", 1.0)):
        value, low, high = (per * found[f"{name}{end}_{unit[-1]}"].to_numpy() for end in ("", "_lo90", "_hi90"))
        truth = rows[f"{column}_{unit}"].to_numpy()
        if nearer.any():
            truth = np.where(nearer, rows[f"{column}_2_{unit}"], truth)
        wrong[name] = (np.abs(value - truth) > high - low) & ~flagged
        held = (low <= truth) & (truth <= high)
        out[f"{name}_in_90"] = float(held[~flagged].mean()) if not flagged.all() else np.nan
    place = wrong["x0"] | wrong["y0"]
    return {"frames": len(rows), "flagged": float(flagged.mean()), **out, "silent_place": float(place.mean()),
            "silent_F": float(wrong["F"].mean()), "silent": float((place | wrong["F"]).mean())}


def main() -> None:
    if len(sys.argv) not in (4, 5):
        raise SystemExit("silent_answers.py: give a forward model, its card, a folder, and a seed if you like.")
    warnings.simplefilter("ignore")
    model, folder, seed = surrogate.load(sys.argv[1]), Path(sys.argv[3]), int((*sys.argv, "1")[4])
    folder.mkdir(parents=True, exist_ok=True)
    touches, rng, rows = simulated(folder, sys.argv[2], quick(40, 8), seed), np.random.default_rng(seed), []
    volts = {name: one.filter(regex="^v_").to_numpy(float) for name, one in touches.items()}
    single = touches["single"]
    base = volts["single"][0] - single.filter(regex="^dv_").to_numpy(float)[0]
    for level in LEVELS:
        each = noises(base, float(np.sqrt(np.mean(base**2))) * 10 ** (-level / 20), rng)
        cases = [(name, "white", "white", volts[name]) for name in touches if name != "single"]
        cases += [("single", name, name, volts["single"]) for name in each]
        cases += [("foreign noise", "white", name, volts["single"])
                  for name in ("pattern", "neighbours", "heavy-tailed")]
        cases += [(f"conductance x{k:g}", "white", "white", volts["single"] / k) for k in (1.02, 0.98)]
        for kind, untouched, noise, frames in cases:
            known = touches.get(kind, single)
            rows.append({"kind": kind, "db": level, "untouched": untouched, "noise": noise, **scored(
                model, known, frames + each[noise](len(frames)), base + each[untouched](BASELINES))})
    shown(written(rows, "silent_answers"))


if __name__ == "__main__":
    main()
