"""Which sensor the paper's networks fit: skins and punches of the same touches, against the errors that it states.

    python benchmarks/variants.py CARD [--scenes N] [--epochs N] [--within MM] [--only WORDS]

Each variant sweeps the paper's touches (diameters of 10 to 18 mm, 0.1 to 2 N) within a distance of the disc's centre
under another skin or punch, all from one table of load paths, and trains the paper's networks (`trainbr`, 208 readings,
20 hidden units) for its eight outputs on 70 % of the rows, without noise. A row each variant and output: the RMSE of
training and of unseen rows, the paper's, and the second singular value of the signals over the first, which tells how
much they carry besides one number. Writes results/variants.csv.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from conditions import quick, shown, written
from faithful import PAPER

from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run.sweep import sweep
from surrogate.data.samples import Samples, read_samples
from surrogate.model.evaluate import UNSEEN, evaluate
from surrogate.model.train import train

SEED, SCENES, EPOCHS, WITHIN_MM, WORKERS = 1, quick(600, 60), quick(150, 5), 45.0, 2
# what each variant changes of the design, table by table
VARIANTS: dict[str, dict[str, dict[str, Any]]] = {
    **{f"{strain}, insulated": {"skin": {"strain": strain}} for strain in ("normal", "principal", "areal")},
    **{f"{strain}, conducting": {"skin": {"strain": strain}, "punch": {"conductor": True}}
       for strain in ("normal", "principal", "areal")},
    **{f"{strain}, conducting by {z:g} Ohm m2": {"skin": {"strain": strain}, "punch": {
        "conductor": True, "contact_impedance_Ohm_m2": z}} for strain in ("normal", "principal") for z in (1e-3, 1e-2)},
    **{f"{strain}, insulated, any diameter": {"skin": {"strain": strain}, "punch": {"diameter_mm": [10, 18]}}
       for strain in ("normal", "principal")}}


def samples_of(card: Path, changes: dict[str, dict[str, Any]], scenes: int, within_mm: float) -> Samples:
    """The paper's touches under a variant."""
    punch = {"place": {"within_mm": within_mm}, "diameter_mm": {"choice": [10, 12, 14, 16, 18]}, "force_N": [0.1, 2.0]}
    design = design_from({"seed": SEED, **changes, "punch": punch | changes.get("punch", {})}, scenes)
    with tempfile.TemporaryDirectory() as folder:
        sweep(design, card, Path(folder) / "sweep", workers=WORKERS, reuse=True)
        return read_samples(Path(folder) / "sweep")


def scored(name: str, samples: Samples, epochs: int) -> Iterator[dict[str, object]]:
    """One row an output."""
    singular = np.linalg.svd(samples.signal_V, compute_uv=False)
    model = train(samples, "trainbr", tuple(PAPER), SEED, epochs=epochs, workers=WORKERS)
    for output, parts in evaluate(model, samples, ()).scores["outputs"].items():
        unseen = next(parts[part] for part in UNSEEN if part in parts)
        yield {"variant": name, "output": output, "unit": unseen["unit"], "train_rmse": parts["train"]["rmse"],
               "rmse": unseen["rmse"], "paper_rmse": PAPER[output], "over_paper": unseen["rmse"] / PAPER[output],
               "r2": unseen["r2"], "second_singular": singular[1] / singular[0], "rows": parts["train"]["n"],
               "scored_rows": unseen["n"], "epochs": epochs, "fit_s": model.fit_s}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("card", type=Path, help="material card that `matcal fit` wrote")
    parser.add_argument("--scenes", type=int, default=SCENES)
    parser.add_argument("--epochs", type=int, default=EPOCHS)
    parser.add_argument("--within", type=float, default=WITHIN_MM, help="largest distance from the centre, mm")
    parser.add_argument("--only", default="", help="variants whose name has these words")
    asked = parser.parse_args()
    rows: list[dict[str, object]] = []
    for name, changes in VARIANTS.items():
        if asked.only in name:
            rows += scored(name, samples_of(asked.card, changes, asked.scenes, asked.within), asked.epochs)
            shown(written(rows, "variants"))


if __name__ == "__main__":
    main()
