"""Memory of a sweep's parent over the number of scenes, and what parts cost to write and to read.

Scenes are light: touches beyond the rim, which are refused at once, so that the sweep itself is what is measured; the
rows of a second table hold random numbers in all columns, as solved ones do. Run by `make bench`, which pins threads;
writes results/sweep_memory.csv and results/sweep_parts.csv next to this file.
"""

import os
import tempfile
import time
from pathlib import Path

import numpy as np
from conditions import quick, shown, written

from eitsim.scene.drive import voltage_columns
from eitsim.sweeps.dataset.parquet import FIXED, read_dataset, write_manifest, write_part
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run.sweep import Progress, sweep
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

TABLE_1 = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
CARD = MaterialCard("Table 1", TABLE_1, conductivity=Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4)))
AT = quick((1000, 5000, 10000, 20000), (250, 500))
ROWS = quick(1280, 256)


def resident_MB() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def memory(folder: Path) -> None:
    """Write the parent's memory at some numbers of scenes."""
    write_card(CARD, folder / "card.json")
    design = design_from({"scenes": AT[-1], "punch": {"x_mm": 99.0, "y_mm": [0.0, 1.0]}})
    rows: list[dict[str, object]] = []
    cpu, wanted = time.process_time(), list(AT)

    def note(step: Progress) -> None:
        if wanted and step.done >= wanted[0]:
            rows.append({"scenes": wanted.pop(0), "parent_MB": resident_MB(),
                         "parent_cpu_s": time.process_time() - cpu})
            print(rows[-1], flush=True)
            written(rows, "sweep_memory")

    sweep(design, folder / "card.json", folder / "set", workers=2, reuse=False, progress=note)


def parts(folder: Path, size: int) -> dict[str, object]:
    """What it takes to write and to read rows in parts of one size."""
    rng, names = np.random.default_rng(0), [*voltage_columns(208), *voltage_columns(208, "dv")]
    whole = [dict.fromkeys(FIXED, 0.5) | {"scene": i, "outcome": "ok"}
             | dict(zip(names, rng.random(len(names)).tolist(), strict=True)) for i in range(ROWS)]
    folder.mkdir()
    design = {"scenes": ROWS, "seed": 0, "sampler": "random", "tables": {}}
    write_manifest(folder, {"design": design, "card": {}, "versions": {}})
    wall, cpu = time.perf_counter(), time.process_time()
    for first in range(0, ROWS, size):
        write_part(folder, whole[first:first + size])
    wrote, waited = time.process_time() - cpu, time.perf_counter() - wall
    cpu = time.process_time()
    read_dataset(folder)
    taken = sum(path.stat().st_size for path in folder.glob("*.parquet"))
    return {"rows_per_part": size, "write_cpu_ms_per_row": 1e3 * wrote / ROWS, "write_wall_ms_per_row":
            1e3 * waited / ROWS, "read_cpu_ms_per_row": 1e3 * (time.process_time() - cpu) / ROWS,
            "bytes_per_row": taken / ROWS}


def main() -> None:
    with tempfile.TemporaryDirectory() as place:
        sizes = [parts(Path(place) / str(size), size) for size in (8, 16, 64, 256)]
        shown(written(sizes, "sweep_parts"))
        memory(Path(place))


if __name__ == "__main__":
    main()
