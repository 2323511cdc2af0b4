"""The simulation report: one touch from its `result.json`, or a data set from the folder that `eitsim sweep` wrote."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from eitsim.scene.curved.curved_scene import is_curved
from eitsim.scene.scene import is_list, scene_from, scene_tables
from eitsim.sweeps.dataset import code_history, parquet
from eitsim.sweeps.dataset.parquet import MANIFEST, OUTPUTS, TOUCH, Dataset, parts, read_dataset
from eitsim.sweeps.design.distributions import Distribution, distribution_of
from eitsim.sweeps.design.variables import number_of_touches
from reports.document import provenance
from reports.document.numerals import counted, number, percent
from reports.document.page import Report, ReportFigure, Table, write_pdf
from reports.document.style import house
from reports.document.verdict import (
    ERROR,
    EXTRAPOLATED,
    LOST,
    NOT_USABLE,
    USABLE,
    Verdict,
    graded,
    no_better,
    real,
    worst,
)
from reports.sweep import account_tables, sweep_figures
from reports.sweep.sweep_figures import Columns
from reports.touch import touch_report
from reports.touch.reading_figures import Array
from touchcal.errors import InputFileError

if TYPE_CHECKING:
    from eitsim.sweeps.run.account import Accounted

# outcomes whose messages are shown, and letters of one
MOST, LETTERS = 4, 240
NO_SCENE = "Not there: no scene of the set has the outcome “ok”."
# of a scene, next to what every row holds
ACCURACY = ("signal_error", "depth_error", "cpu_s")
_COLUMNS = (*ACCURACY, "message", "touches")  # what is read next to dataset.FIXED; signals are read separately


def write(source: Path, out: Path) -> None:
    """Write the PDF of a result of `eitsim run` (a JSON file) or of a data set of `eitsim sweep` (a folder).
    InputFileError where `source` is neither; ValueError where the folder of `out` is missing."""
    with house():
        write_pdf(report(source) if source.is_dir() else touch_report.report(source), out)


def report(folder: Path) -> Report:
    """Everything that the template `sweep.typ` shows of a data set; InputFileError where the folder is none."""
    from eitsim.sweeps.run.account import account_of

    data, account = read_dataset(folder, _COLUMNS), account_of(folder)
    solved = (data.table["outcome"] == "ok").to_numpy()
    ok, failed = _columns(data, solved), _columns(data, ~solved)
    tables = _outcome_tables(data) | {"stages": account_tables.stage_table(account),
                                      "design": _design_table(data.design)}
    absent: dict[str, str] = {} if account.stages else {"stages": "Its rows tell no CPU time."}
    plates: list[ReportFigure] = []
    if solved.any():
        plates = _plates(folder, data, ok, failed)
    else:
        absent |= dict.fromkeys(("map", "ranges", "accuracy"), NO_SCENE)
    cautions = [f"Stale: {words}."] if (words := code_history.other_code(data.manifest)) else []
    subtitle = counted(len(data.table), "simulated scene")
    if card := data.manifest.get("card"):
        subtitle += f" with card {provenance.card_words(card)}"
    return Report("sweep", "Data set of touches", subtitle, _footer(folder, data), _findings(data, account, ok), plates,
                  tables, absent, _prose(data, account), cautions, verdict=_verdict(data, account, ok, bool(cautions)))


def _columns(data: Dataset, rows: np.ndarray) -> Columns:
    """The numeric columns of some rows, readings left aside."""
    names = [n for n in ("scene", *TOUCH, *OUTPUTS, *ACCURACY) if n in data.table]
    return {name: data.table[name].to_numpy(dtype=float)[rows] for name in names}


def _footer(folder: Path, data: Dataset) -> dict[str, Any]:
    files = [provenance.source(path) for path in parts(folder)]
    sources = [provenance.source(folder / MANIFEST),
               provenance.combined(counted(len(files), "Parquet part") + ", hash of their hashes", files)]
    return provenance.footer(sources, provenance.seed_words(data.design.get("seed")))


def _findings(data: Dataset, account: Accounted, ok: Columns) -> list[str]:
    asked, present, solved = data.design["scenes"], len(data.table), ok["scene"].size
    lost = f"; {present - solved} did not, see their messages" if solved < present else ""
    found = [f"{solved} of {counted(present, 'scene')} ended ok{lost}."]
    if present < asked:
        found.append(f"The set is unfinished: the design asks for {asked} scenes, {present} are there.")
    most = int(np.nanmax(data.table["touches"].to_numpy(dtype=float))) if "touches" in data.table else 1
    if most > 1:
        found.append(f"A scene has up to {most} touches; figures and tables show the first of each, readings tell of "
                     "all together.")
    if solved:
        cost = ok["cpu_s"]
        found += account_tables.findings(account)
        found.append(f"A scene costs {number(float(np.median(cost)))} s of CPU in the median and {number(cost.max())} "
                     "s at most.")
    return found


def _verdict(data: Dataset, account: Accounted, ok: Columns, stale: bool) -> list[Verdict]:
    """What the rows are good for, their signals, and the signals of a real skin."""
    asked, present, solved = data.design["scenes"], len(data.table), ok["scene"].size
    why = f"{solved} of {counted(asked, 'scene')} ended ok" + ("; made by other code than is here" if stale else "")
    grade = graded(1 - solved / asked, LOST)
    found = [Verdict("Rows as designed", worst(grade, USABLE) if stale or present < asked else grade, why)]
    if solved:
        error = float(np.nanquantile(ok["signal_error"], 0.95))
        found.append(Verdict("Signals by the card's law", graded(error, ERROR), f"95 % of them to {percent(error)}, "
                             "estimated"))
    if account.extrapolated:
        median, largest = account.extrapolated
        of_skin = Verdict("Signals of a real skin", graded(median, EXTRAPOLATED), f"{percent(median)} of the signal "
                          f"comes from extrapolated conductivity in the median scene, at most {percent(largest)}")
        found.append(no_better(of_skin, found[-1]))
    elif solved:
        found.append(Verdict("Signals of a real skin", NOT_USABLE, "how much of them is extrapolated "
                             "is not in the rows; sweep again"))
    return found + real("A real sensor", (data.manifest.get("card") or {}).get("synthetic", False))


def _plates(folder: Path, data: Dataset, ok: Columns, failed: Columns) -> list[ReportFigure]:
    given = data.design["tables"]
    plain = [sweep_figures.ranges(ok, TOUCH, [name for name in OUTPUTS if name in ok]), sweep_figures.accuracy(ok)]
    if is_curved(given):
        return plain
    tables = scene_tables(scene_from({key: given[key] for key in ("body", "electrodes") if key in given}))
    rms_V = rms_of(folder, ok["scene"].astype(np.int64))
    placed = np.isfinite(failed["x_mm"]) & np.isfinite(failed["y_mm"])
    off = {name: values[placed] for name, values in failed.items()}
    return [sweep_figures.touch_map(ok, off, rms_V, tables), *plain]


def rms_of(folder: Path, scenes: NDArray[np.int64]) -> Array:
    """(scenes,) RMS of the signals dV of these scenes, V, over the readings that each has. InputFileError where one has
    no columns of signals."""
    found = [pd.Series(np.sqrt(np.nanmean(table.to_numpy(dtype=float)**2, axis=1)), table.index)
             for table in _signals_of(folder, scenes)]
    return pd.concat(found).loc[scenes].to_numpy(dtype=float)


def _signals_of(folder: Path, scenes: NDArray[np.int64]) -> Iterator[pd.DataFrame]:
    """Signals of these scenes, V, by scene; part by part, so that no more than one is held at a time."""
    for path in parquet.parts(folder):
        asked = np.isin(parquet.read_part(path, ["scene"])["scene"].to_numpy(), scenes)
        if not asked.any():
            continue
        columns = sorted(name for name in parquet.columns_of(path) if name.startswith("dv_"))
        if not columns:
            raise InputFileError(folder, "the data set has scenes that ended ok but no columns dv_000 ...; sweep "
                                         "again.")
        yield parquet.read_part(path, ["scene", *columns]).loc[asked].set_index("scene")


def _outcome_tables(data: Dataset) -> dict[str, Table]:
    """How often each outcome is there, and why."""
    outcomes = [str(o) for o in data.table["outcome"]]
    said = data.table["message"] if "message" in data.table else [""] * len(outcomes)
    messages = [m if isinstance(m, str) else "" for m in said]
    counts = Counter(outcomes).most_common()
    rows = [[outcome, str(count), percent(count / len(outcomes), 3)] for outcome, count in counts]
    tables = {"outcomes": Table(f"How the scenes ended: {counted(len(rows), 'kind')} of outcome.",
                                ["outcome", "scenes", "share"], rows, "wrr")}
    first = {outcome: next((m for o, m in zip(outcomes, messages, strict=True) if o == outcome and m), "")
             for outcome, _ in counts}
    if reasons := [[outcome, _shortened(message)] for outcome, message in first.items() if message and outcome != "ok"]:
        tables["reasons"] = Table("The first message of each outcome but ok.", ["outcome", "first message"],
                                  reasons[:MOST], "lw")
    return tables


def _shortened(message: str) -> str:
    return message if len(message) <= LETTERS else message[:LETTERS].rsplit(" ", 1)[0] + " ..."


def _design_table(design: Mapping[str, Any]) -> Table:
    rows = [[key, str(design[key])] for key in ("scenes", "seed", "sampler")]
    rows += [[f"{name}.{key}", str(cell)] for name in ("material", "measurement", "fields")
             for key, cell in (design.get(name) or {}).items() if cell not in (None, [], 0, False)]
    if source := design.get("source"):
        rows.append(["table", f"{source['file']}, sha256 {source['sha256'][:12]}"])
    drawn = 0
    touches = number_of_touches(design.get("touches"))
    if touches is not None:
        drawn += isinstance(touches, Distribution)
        rows.append(["touches", touches.words if isinstance(touches, Distribution) else str(touches)])
    for name, value in design["tables"].items():
        for i, table in enumerate(value if isinstance(value, list) else [value]):
            where = f"{name} {i + 1}" if isinstance(value, list) and len(value) > 1 else name
            for key, cell in table.items():
                words = None if is_list(name, key, cell) else _words(key, cell)
                drawn += words is not None
                rows.append([f"{where}.{key}", str(cell) if words is None else words])
    caption = f"The design: {counted(drawn, 'quantity', 'quantities')} given as a range or distribution."
    return Table(caption, ["key", "value"], rows, "lw")


def _words(key: str, cell: Any) -> str | None:
    """How a key of a design is drawn, in words; None for a plain value."""
    if key == "place":
        limits = ", ".join(f"{name} {value:g}" for name, value in cell.items() if isinstance(value, int | float))
        held = [f"{len(value)} places by {name}" if isinstance(value, list) else f"{value} grid"
                for name, value in cell.items() if isinstance(value, list | str)]
        return ", ".join([*(held or ["uniform over the skin where the punch fits"]), *([limits] if limits else [])])
    distribution = distribution_of(key, cell)
    return None if distribution is None else distribution.words


def _prose(data: Dataset, account: Accounted) -> dict[str, Any]:
    prose: dict[str, Any] = {"conditions": _conditions(data)}
    if said := account_tables.left_out(account):
        prose["left_out"] = said
    return prose | provenance.origin(data.manifest)


def _conditions(data: Dataset) -> list[str]:
    """Which cards served the rows, and what an instrument added to them."""
    said, design = [], data.design
    if (material := design.get("material")) is not None:
        drawn = data.table["card_sample"].to_numpy(dtype=float)
        parts = f", in {' and '.join(material['parts'])} alone" if material.get("parts") else ""
        rows = material.get("rows_per_draw") or 1
        said.append(f"Whole cards are drawn from the posterior{parts}: {len(np.unique(drawn[drawn >= 0]))} of its "
                    f"samples serve the scenes, {counted(rows, 'scene')} in a row with each"
                    + ("; further specimens, stiffer or softer as replicates scatter." if material.get("specimen")
                       else "."))
    if "measured" in data.manifest:
        measured = data.manifest["measured"]
        said.append(f"Readings are as an instrument gives them: noise of {number(measured['noise_V'])} V in one frame, "
                    f"all terms together {number(measured['signal_error_V'])} V rms in the signal; "
                    f"{measured['clipped']} samples clipped.")
    elif design.get("measurement"):
        said.append("Readings are clean; the design's [measurement] is applied by “eitsim measure”.")
    touches = data.table["touches"].dropna() if "touches" in data.table else []
    if len(counts := Counter(int(n) for n in touches)) and max(counts) > 1:
        said.append(", ".join(f"{counted(counts[n], 'scene')} with {counted(n, 'touch', 'touches')}"
                              for n in sorted(counts)) + ".")
    return said
