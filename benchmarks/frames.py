"""How fast frames without end are made, and how far their signals are from the simulator's.

A forward model is trained on 500 touches of the documented design; 1,000 others, a touch of their own each, are
compared with their solutions. Of some the electrodes are moved, or have other contact impedances, and their readings
are solved again on the stored load path of the touch. Run by `make bench`, which pins threads; writes
results/frames.csv.
"""

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from conditions import quick, written
from timing import least_cpu_s

import eitsim
import surrogate
from eitsim.scene.electrodes import middles
from eitsim.simulation.choose import served
from eitsim.simulation.simulate import readings_of
from eitsim.sweeps.design.design import read_design
from surrogate.data.samples import read_samples, take
from surrogate.live.skins import simulated_skin

ROOT = Path(__file__).parents[1]
TAUGHT, ASKED, MOVED = quick((500, 1000, 40), (100, 60, 6))
LEVELS = {"snr_db": [60, 90], "gain": 1e-3, "offset_V": 1e-5, "contact_spread": 0.2, "contact_impedance": 0.01,
          "position_mm": [0, 0.5], "drift": 1e-4, "drift_channel": 1e-4, "dead": 0.01}


def errors(what: str, error: list[float]) -> dict[str, object]:
    return {"what": what, "count": len(error), "median": np.median(error), "p95": np.quantile(error, 0.95),
            "largest": max(error), "within_1_percent": np.mean(np.array(error) <= 0.01)}


def relative(found: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.linalg.norm(found - right, axis=-1) / np.linalg.norm(right, axis=-1)


def solved_again(skin: surrogate.TouchMap, simulated, touches: np.ndarray, moved_mm: float,
                 contacts: float) -> list[float]:
    rng, found = np.random.default_rng(5), []
    for touch in touches:
        turned = moved_mm / skin.radius_mm * rng.standard_normal(skin.electrodes)
        ohm_m = np.exp(contacts * rng.standard_normal(skin.electrodes))
        punch = replace(simulated.scene.punches[0], x_m=touch[0] / 1e3, y_m=touch[1] / 1e3, depth_m=None,
                        diameter_m=touch[2] / 1e3, force_N=touch[3])
        electrodes = simulated.scene.electrodes
        scene = replace(simulated.scene, punches=(punch,), electrodes=replace(
            electrodes, angles_rad=tuple(middles(electrodes) + turned), contact_impedance_Ohm_m=tuple(ohm_m)))
        (path,) = served(simulated.table, simulated.material.law, scene)
        if path is not None:
            right = readings_of(scene, (path,), simulated.material.skin, exact=False).signal_V.ravel()
            found.append(float(relative(skin.signals(touch[None], turned[None])[0], right)))
    return found


def speeds(skin: surrogate.TouchMap) -> list[dict[str, object]]:
    import torch

    torch.set_num_threads(1)
    rows = []
    for what, made in (("frames, all levels", eitsim.frames(skin, sensor=eitsim.Scene(), **LEVELS)),
                       ("frames, noise alone", eitsim.frames(skin, snr_db=60))):
        rows.append({"what": what, "rows_per_s": made.rows / least_cpu_s(lambda made=made: made.block(3), 5)})
    touch = eitsim.frames(skin).block(0)["touch"] / [1e3, 1e3, 1e3, 1]
    for name in ("float32", "float64"):
        dtype = getattr(torch, name)
        module, contacts = surrogate.Skin(skin, noise_V=1e-4, dtype=dtype), torch.tensor(touch, dtype=dtype)[:, None]
        with torch.no_grad():
            rows.append({"what": f"Skin, {name}", "rows_per_s": len(touch) / least_cpu_s(
                lambda module=module, contacts=contacts: module(contacts), 5)})
    return rows


def main(folder: Path) -> None:
    design = replace(read_design(ROOT / "examples/design.toml"), scenes=TAUGHT + ASKED, seed=53)
    card = ROOT / "reports/out/card.json"
    eitsim.sweep(design, card, out=folder / "sweep", workers=1, reuse=True)
    samples = read_samples(folder / "sweep")
    begun = time.process_time()
    model = surrogate.train(take(samples, np.arange(TAUGHT)), method="forward", seed=1)
    skin = surrogate.touch_map(model)
    rows: list[dict[str, object]] = [{"what": "training", "count": TAUGHT, "cpu_s": time.process_time() - begun}]
    asked = take(samples, np.arange(TAUGHT, len(samples)))
    rows.append(errors("as trained", relative(skin.signals(asked.target[:, :4]), asked.signal_V).tolist()))
    simulated = simulated_skin(model, card, data=folder / "sweep")
    for what, moved_mm, contacts in (("electrodes moved 0.5 mm", 0.5, 0.0), ("electrodes moved 1 mm", 1.0, 0.0),
                                     ("contact impedances 20 %", 0.0, 0.2), ("0.5 mm and 20 %", 0.5, 0.2)):
        rows.append(errors(what, solved_again(skin, simulated, asked.target[:MOVED, :4], moved_mm, contacts)))
    written(rows + speeds(skin), "frames")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        main(Path(made))
