"""What a frame of the live page costs on a skin with an outline against a disc, CPU milliseconds of one process.

A disc of 200 mm and a rectangle of 120 x 80 mm with 16 electrodes, and that rectangle with 32: a punch of 10 mm on 5 mm
of table 1's foam, 0.02 to 0.5 N, ROWS scenes each, a forward model that reads x, y, d and F. PRESSES presses of 0.3 N
somewhere where they may be pressed, each held for HELD frames with noise 80 dB below the untouched readings.
simulated_ms and map_ms: the answer to a press by the simulator from its tables, and by the model's own map; first_ms:
reading the first frame of a press, which is searched for; frame_ms: reading a later one, which is followed. Medians,
and 95 % quantiles in the columns _95_ms. export_MB: size of the page as one file. load: processes that asked for the
machine's cores in the minute before, which lengthen CPU times too. Writes results/live_frames.csv next to this file.
"""

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from conditions import quick, shown, written
from outline_sweep import CARD, PUNCH

import eitsim
import matcal
import surrogate
from eitsim.sweeps.design.design import design_from
from surrogate.live.controls import Controls
from surrogate.live.export_page import export_page
from surrogate.live.skins import Skin, learned_skin, limits_of, simulated_skin

RECTANGLE = {"outline": "rectangle", "width_mm": 120, "height_mm": 80, "thickness_mm": 5}
CASES = {"disc": ({"radius_mm": 100, "thickness_mm": 5}, {"count": 16}),
         "rectangle": (RECTANGLE, {"count": 16, "width_mm": 8}),
         "rectangle, 32 electrodes": (RECTANGLE, {"count": 32, "width_mm": 6})}
ROWS, PRESSES, HELD, FORCE_N = quick(150, 60), quick(25, 3), 8, 0.3
WITHIN_MM = 60  # of the disc's centre


def spent_ms(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU time of some work, and what it returns."""
    begun = time.process_time()
    found = work()
    return 1e3 * (time.process_time() - begun), found


def places(model: surrogate.SweepModel) -> list[Controls]:
    """Presses where they may be pressed, in the box of the calibrating ones."""
    limits, rng, found = limits_of(model), np.random.default_rng(1), []
    low, high = model.calibration.target[:, :2].min(axis=0), model.calibration.target[:, :2].max(axis=0)
    while len(found) < PRESSES:
        x, y = rng.uniform(low, high).tolist()
        if limits.edges.held((x, y), limits.gap_mm) == (x, y) and not limits.edges.refuses((x, y), 10, limits.gap_mm):
            found.append(Controls(x, y, 10.0, FORCE_N))
    return found


def row_of(case: str, folder: Path) -> dict[str, Any]:
    body, electrodes = CASES[case]
    # others keep from edges by themselves
    punch = PUNCH | ({"place": {"within_mm": WITHIN_MM}} if case == "disc" else {})
    tables = {"seed": 5, "body": body, "electrodes": electrodes, "punch": punch, "accuracy": {"signal": 0.02}}
    eitsim.sweep(design_from(tables, ROWS), CARD, folder / "sweep", reuse=True)
    matcal.write_card(CARD, folder / "card.json")
    model = surrogate.train(folder / "sweep", outputs="x0,y0,d,F", seed=1)
    export_page(model, folder / "page.html")
    skins: dict[str, Skin] = {"simulated": simulated_skin(model, folder / "card.json", folder / "sweep"),
                              "map": learned_skin(model)}
    rng, noise_V = np.random.default_rng(2), 1e-4 * float(np.sqrt(np.mean(model.baseline_V**2)))
    tracker = surrogate.Tracker(model, model.baseline_V, noise_V)
    spent: dict[str, list[float]] = {"simulated": [], "map": [], "first": [], "frame": []}
    for k, press in enumerate(places(model)):
        signal_V = np.zeros_like(model.baseline_V)
        for name, skin in skins.items():
            took, answer = spent_ms(lambda skin=skin, press=press: skin.pressed(press))
            assert answer.problem == "", answer.problem
            signal_V = answer.signal_V if name == "simulated" else signal_V
            if k:  # the first press compiles and fills tables
                spent[name].append(took)
        for held in range(-3, HELD):
            frame_V = model.baseline_V + (signal_V if held >= 0 else 0) + noise_V * rng.normal(size=len(signal_V))
            took, _ = spent_ms(lambda frame_V=frame_V: tracker.update(frame_V))
            if k and held >= 0:
                spent["frame" if held else "first"].append(took)
    row: dict[str, Any] = {"skin": case, "readings": len(model.baseline_V), "presses": PRESSES - 1}
    for name, values in spent.items():
        row |= {f"{name}_ms": float(np.median(values)), f"{name}_95_ms": float(np.quantile(values, 0.95))}
    return row | {"export_MB": (folder / "page.html").stat().st_size / 1e6, "load": os.getloadavg()[0]}


def main() -> None:
    rows = []
    for case in CASES:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(row_of(case, Path(folder)))
            shown(written(rows, "live_frames", 3))


if __name__ == "__main__":
    main()
