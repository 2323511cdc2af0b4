"""The source paper walked through with our own data: stages made where needed, then figures 1, 3 to 19 and table 1."""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.paper import choices, learning, material, networks_table, ratios, simulation, variants
from benchmarks.paper.section import FULL_STAGES, Section, comparison, found, full_numbers
from benchmarks.paper.stages import LOG, content, made, read_record, state
from benchmarks.paper.stages_plan import CARD, COST, FULL, NETWORKS, SEED, SWEEP, Run, stale, write_scenes
from eitsim.sweeps.dataset.parquet import MANIFEST, read_manifest
from matcal.card import read_card
from reports.document import provenance
from reports.document.numerals import counted, number
from reports.document.page import CONTENTS, Report, ReportFigure, Table, read_contents, write_pdf
from reports.document.style import house
from reports.document.verdict import Verdict

NUMBERS, STAGES = "numbers.csv", "stages.csv"
PNG_DPI = 200
# order of the figures on the pages; C and A are what the paper has no figure of
ORDER = ("1", "3", "4", "5", "T1", "6", "7", "8", "9", "10", "11", "C", "A", *(str(k) for k in range(12, 20)))
NAMES = {"T1": "Table 1", "C": "Open choices", "A": "Amplitude"}
ELSEWHERE = "Figure 2 is a photograph of the test set-up and has no counterpart here."
# whose difference stands in words on the first page, next to the ratios of all
SUMMARISED = ("T1", "8", "9")
# figures 1 and 3 to 19
FIGURES = 18
RECORDED = ("cpu_s", "wall_s", "machine", "date", "key", "code", "results")


def make(run: Run, work: Path, say: Callable[[str], None] = print) -> None:
    """Make the stages of a run that are not current, one after the other; ValueError, NotConverged as `made`."""
    write_scenes(work)
    for count, (name, stage) in enumerate(run.stages.items(), 1):
        begun = f"{count} of {len(run.stages)}, {name}: "
        if state(stage) == "current":
            say(f"{begun}kept, made from the same")
            continue
        say(f"{begun}begun, its words go to {stage.folder / LOG}")
        made(stage)
        record = read_record(stage.folder) or {}
        say(f"{begun}{record['wall_s']:.1f} s, {record['cpu_s']:.1f} CPU s")


def write(run: Run, folder: Path, *, png: bool = True) -> Path:
    """Draw paper.pdf into a folder, its figures as SVG, PNG and CSV next to it, and its numbers as two tables. Stages
    whose results are not there are said to be missing, those made from something else to be stale."""
    out = folder / "paper.pdf"
    with house():
        parts = sections(run)
        report = report_of(run, parts)
        write_pdf(report, out)
        if png:
            _write_png(report.plates, folder / "paper_files")
    found(parts).to_csv(folder / NUMBERS, index=False, float_format="%.6g")
    stage_table(run).to_csv(folder / STAGES, index=False, float_format="%.4g")
    return out


def sections(run: Run) -> list[Section]:
    """All sections, in the order of the paper."""
    found = [*material.sections(run), simulation.potentials(run), simulation.meshes(run),
             simulation.convergence(run), simulation.holds(run), *simulation.touched(run),
             choices.section(run), learning.amplitude(run), *learning.sections(run)]
    return sorted(found, key=lambda section: ORDER.index(section.figure))


def report_of(run: Run, parts: Sequence[Section]) -> Report:
    """Everything that the template `paper.typ` shows."""
    full = None if run.setting == FULL else full_numbers()
    old = stale(run)
    tables: dict[str, Table] = {"stages": _stage_words(run, old)}
    known = ratios.ratios(parts)
    if known:
        tables["ratios"] = ratios.table(known, full)
    summary, networks_words = _networks(run)
    tables |= summary
    for section in parts:
        if (table := comparison(section, full)) is not None:
            tables[f"numbers_{section.figure}"] = table
        tables |= {f"table_{section.figure}_{k}": table for k, table in enumerate(section.tables)}
    plates = [plate for section in parts for plate in section.plates]
    prose = {"order": [section.figure for section in parts], "elsewhere": ELSEWHERE, "full": _full_words(run, full),
             "networks": networks_words}
    for section in parts:
        prose |= _words(section, old)
    absent = {section.figure: section.missing for section in parts if section.missing}
    cautions = [f"Stale: {', '.join(name for name in old if old[name] == why)}: {why}"
                for why in dict.fromkeys(old.values())]
    return Report(Path(__file__).with_name("paper.typ"), "The paper, walked through", _subtitle(run), _footer(run),
                  _findings(parts, old, _old_full(run) if full is not None else []), plates, tables, absent, prose,
                  cautions, verdict=_verdict(run, known, full))


def _verdict(run: Run, known: Sequence[ratios.Ratio], full: pd.DataFrame | None) -> list[Verdict]:
    """Of the run at full size where its numbers are there: a quick run shows how it is done, not how well it can be."""
    judged, of = (known, "") if full is None else (ratios.of_full(full), "the run at full size")
    return [*ratios.verdict(judged, _synthetic(run), of)]


def _networks(run: Run) -> tuple[dict[str, Table], str]:
    """The tables of the paper's networks for the first pages, and what is to be said of them."""
    found, search = learning.model_of(run, NETWORKS), variants.read()
    if found is None:
        return {}, ""
    scores = found[1]["outputs"]
    tables = {"networks": networks_table.errors(scores, pd.read_parquet(found[2]))}
    if search and networks_table.far_off(scores):
        tables["causes"] = networks_table.causes(scores, search, choices.taken(run))
    learned = (f" These networks learned from {counted(found[0]['dataset']['split']['train'], 'row')} in at most "
               f"{run.setting.epochs} steps.")
    return tables, networks_table.PAPER_R + learned + ("" if search else f" {variants.NOT_RUN}")


def _synthetic(run: Run) -> bool:
    return run.card.is_file() and bool(read_card(run.card).provenance.get("synthetic"))


def _words(section: Section, old: Mapping[str, str]) -> dict[str, str]:
    name = NAMES.get(section.figure, f"Figure {section.figure}")
    marks = [stage for stage in section.stages if stage in old]
    return {f"title_{section.figure}": f"{name}: {section.title}", f"says_{section.figure}": section.says,
            f"chosen_{section.figure}": section.chosen, f"differs_{section.figure}": section.differs,
            f"followed_{section.figure}": section.followed,
            f"stale_{section.figure}": f"Stale: {', '.join(marks)}. See the first page." if marks else "",
            f"name_{section.figure}": name if name.startswith("T") else name[0].lower() + name[1:],
            f"plates_{section.figure}": ",".join(plate.name for plate in section.plates),
            f"tables_{section.figure}": str(len(section.tables))}


def _subtitle(run: Run) -> str:
    scenes = "no sweep"
    if (run.sweep / MANIFEST).is_file():
        scenes = counted(int(read_manifest(run.sweep)["design"]["scenes"]), "scene")
    return (f"Elkhodbia, Barsoum, Korkees, Bojanampati: Finite element modeling of the electrical impedance tomography "
            f"technique driven by machine learning. {run.setting.name.capitalize()} run, {scenes}")


def _footer(run: Run) -> dict[str, Any]:
    places = [place for place in (run.card, run.sweep, *(stage.folder for stage in run.stages.values()
                                                        if stage.folder not in (run.card.parent, run.sweep)))
              if place.exists()]
    sources = [content(place) for place in places]
    shown = [source for source in sources if source.name in (run.card.name, run.sweep.name)]
    rest = [source for source in sources if source not in shown]
    if rest:
        shown.append(provenance.combined(f"{counted(len(rest), 'further stage')}, hash of their hashes", rest))
    return provenance.footer(shown, f"seed {SEED}")


def _findings(parts: Sequence[Section], old: Mapping[str, str], old_full: Sequence[str]) -> list[str]:
    there = [section for section in parts if not section.missing]
    drawn = sum(section.figure not in NAMES for section in there)
    table = "and its Table 1" if any(section.figure == "T1" for section in there) else "but not its Table 1"
    said = [f"{drawn} of the paper's {FIGURES} figures of data {table} are set next to our own; "
            f"{counted(len(old), 'stage')} of this run {'is' if len(old) == 1 else 'are'} stale"
            + (f", and {len(old_full)} of the run at full size." if old_full else ".")]
    said += [f"{NAMES.get(section.figure, f'Figure {section.figure}')}: {section.differs}" for section in there
             if section.figure in SUMMARISED]
    return said


def _full_words(run: Run, full: pd.DataFrame | None) -> str:
    if run.setting == FULL:
        return "This is the run at full size."
    if full is None or not FULL_STAGES.is_file():
        return "The numbers of a run at full size are not there."
    rows = pd.read_csv(FULL_STAGES)
    marked = _other_code(run, rows)
    scenes = full.loc[(full["figure"] == "12") & (full["quantity"] == "scenes"), "value"]
    count = f" of {scenes.iloc[0]:.0f} scenes" if len(scenes) else ""
    return (f"Columns “full run” hold the committed numbers of a run at full size{count}, made "
            f"{', '.join(sorted(set(rows['date'].dropna())))} on {', '.join(sorted(set(rows['machine'].dropna())))}."
            f"{marked}")


def _other_code(run: Run, rows: pd.DataFrame) -> str:
    """Which stages of the run at full size were made by other code than is here, or do not tell, in words."""
    mixed = rows.loc[rows["state"] == "stale", "stage"].tolist()
    said = [f" Of it, {', '.join(mixed)} was made by other code or another card than the rest."] if mixed else []
    codes, here = _codes(run, rows)
    if old := rows.loc[here.notna() & codes.notna() & (codes != here), "stage"].tolist():
        said.append(f" Stale, made by other code than is here: {', '.join(old)}.")
    if unknown := rows.loc[here.notna() & codes.isna(), "stage"].tolist():
        said.append(f" Not known to be of this code, since their record does not tell: {', '.join(unknown)}.")
    return "".join(said)


def _codes(run: Run, rows: pd.DataFrame) -> tuple[pd.Series, pd.Series]:
    """By which code each stage of the run at full size was made, and would be here; missing where not known."""
    codes = pd.Series(rows.get("code"), index=rows.index, dtype=object)
    code_of = {name: stage.code for name, stage in run.stages.items()}
    return codes, pd.Series([code_of.get(name) for name in rows["stage"]], index=rows.index, dtype=object)


def _old_full(run: Run) -> list[str]:
    """Stages of the run at full size that are stale, or were made by other code than is here."""
    if not FULL_STAGES.is_file():
        return []
    rows = pd.read_csv(FULL_STAGES)
    codes, here = _codes(run, rows)
    return rows.loc[(rows["state"] == "stale") | (here.notna() & codes.notna() & (codes != here)), "stage"].tolist()


def stage_table(run: Run) -> pd.DataFrame:
    """What each stage is, took and was made from: stage, state, CPU and wall time (s), machine, date, key, results."""
    old, rows = stale(run), []
    for name, stage in run.stages.items():
        record = read_record(stage.folder)
        rows.append({"stage": name, "state": "missing" if record is None else "stale" if name in old else "current"}
                    | {key: (record or {}).get(key) for key in RECORDED})
    if run.given_sweep:
        rows.append({"stage": SWEEP, "state": "stale" if SWEEP in old else "given",
                     "results": content(run.sweep).sha256})
    if CARD not in run.stages and run.card.is_file():
        rows.append({"stage": CARD, "state": "given", "results": content(run.card).sha256})
    return pd.DataFrame(rows)


def _stage_words(run: Run, old: Mapping[str, str]) -> Table:
    table = stage_table(run)
    rows = [[str(row["stage"]), str(row["state"]), *(_known(row.get(key)) for key in ("cpu_s", "wall_s")),
             row["results"][:12] if isinstance(row["results"], str) else "–"] for row in table.to_dict("records")]
    spent = sum((read_record(stage.folder) or {}).get("cpu_s", 0.0) for stage in run.stages.values())
    return Table(f"The stages of this run, {number(spent / 60, 2)} CPU minutes in all (a quick run from nothing takes "
                 f"{COST}), and the hash of what each wrote.",
                 ["stage", "state", "CPU (s)", "wall (s)", "results, sha256"], rows, "wlrrr")


def _known(value: Any) -> str:
    return "–" if value is None or math.isnan(value) else number(value)


def _write_png(plates: Iterable[ReportFigure], folder: Path) -> None:
    """The figures as PNG next to their SVG, listed so that the next report forgets them."""
    contents = read_contents(folder)
    for plate in plates:
        plate.figure.savefig(folder / f"{plate.name}.png", dpi=PNG_DPI)
        contents["files"].append(f"{plate.name}.png")
    (folder / CONTENTS).write_text(json.dumps(contents, indent=1) + "\n", encoding="utf-8")
