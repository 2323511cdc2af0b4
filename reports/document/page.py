"""Pages: a Typst template of this package, values as JSON next to it, figures as vector PDF; compiled in-process."""

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
import typst
from matplotlib.figure import Figure

from reports.document import style
from reports.document.verdict import Verdict
from touchcal.document import Keys
from touchcal.json_file import read_json

CONTENTS = "contents.json"
NEARLY_EMPTY_MM = 90.0  # a last page whose text ends above this is not worth a page


@dataclass(frozen=True)
class ReportFigure:
    """One figure of a report."""

    name: str  # its name in the template and its file name
    figure: Figure
    caption: str  # one or two sentences that state what the figure shows, numbers formatted from its data
    data: Mapping[str, pd.DataFrame]  # file stem -> the numbers drawn, units in the column names


@dataclass(frozen=True)
class Table:
    """One table of a report, cells already formatted."""

    caption: str  # what it finds
    head: Sequence[str]  # column heads, units included
    rows: Sequence[Sequence[str]]
    align: str  # one letter a column: l left, r right, w wide (left, shares the remaining width), W twice as wide

    def __post_init__(self) -> None:
        widths = {len(self.head), len(self.align), *(len(row) for row in self.rows)}
        if len(widths) != 1 or set(self.align) - set("lrwW"):
            raise ValueError(f"table '{self.caption}': head, align (letters l, r, w, W) and rows must have one width.")


@dataclass(frozen=True)
class Report:
    """Everything that a template is filled with."""

    template: str | Path  # name of a template of this package without its ending, or the file of another
    title: str
    subtitle: str
    footer: Mapping[str, Any]  # what `provenance.footer` returns
    findings: Sequence[str]  # the most important findings, one sentence each
    plates: Sequence[ReportFigure] = ()
    tables: Mapping[str, Table] = field(default_factory=dict)
    # plate or table -> one sentence that says why it is not there
    absent: Mapping[str, str] = field(default_factory=dict)
    # further paragraphs or lists of sentences, by name
    prose: Mapping[str, str | Sequence[str]] = field(default_factory=dict)
    cautions: Sequence[str] = ()  # what the reader must know before the numbers are used, one sentence each
    # lists of sentences under headings, by name
    groups: Mapping[str, Sequence[tuple[str, Sequence[str]]]] = field(default_factory=dict)
    verdict: Sequence[Verdict] = ()  # what the numbers are good for, the first thing on the first page


def write_pdf(report: Report, out: Path) -> None:
    """Write `out` (PDF) and, in `<stem>_files/` next to it, each figure as SVG and its numbers as CSV. ValueError where
    the folder of `out` is missing; RuntimeError that names the template where it does not compile."""
    if not out.parent.is_dir():
        raise ValueError(f"{out}: the folder {out.parent} does not exist. Create it first.")
    files = out.with_name(f"{out.stem}_files")
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        _stage(report, work)
        written = _export(report.plates, work, files)
        pdf = _compile(Path(report.template).stem, work)
    (files / CONTENTS).write_text(json.dumps({"inputs": report.footer["inputs"], "files": written}, indent=1) + "\n")
    out.write_bytes(pdf)


def _stage(report: Report, work: Path) -> None:
    """Templates and values, side by side; values travel as JSON and are never read as markup."""
    for template in (*Path(__file__).parents[1].rglob("*.typ"), *_own(report)):
        (work / template.name).write_bytes(template.read_bytes())
    values = {"title": report.title, "subtitle": report.subtitle, "footer": report.footer, "findings": report.findings,
              "plates": {plate.name: plate.caption for plate in report.plates},
              "tables": {name: asdict(table) for name, table in report.tables.items()},
              "absent": report.absent, "prose": report.prose, "cautions": report.cautions, "groups": report.groups,
              "verdict": [asdict(line) for line in report.verdict],
              "style": {"accent": style.ACCENT, "grey": style.GREY, "faint": style.FAINT, "ink": style.INK,
                        "warning": style.SECOND, "good": style.THIRD, "usable": style.USABLE}}
    (work / "data.json").write_text(json.dumps(values, allow_nan=False), encoding="utf-8")


def _own(report: Report) -> list[Path]:
    return [report.template] if isinstance(report.template, Path) else []


def read_contents(files: Path) -> dict[str, Any]:
    """What a report wrote into its folder of figures; InputFileError where that cannot be read."""
    return read_json(files / CONTENTS, "the list of a report's files", "Delete it; the report writes it again.",
                     Keys({"files": [str]}))


def _export(plates: Sequence[ReportFigure], work: Path, files: Path) -> list[str]:
    """Draw the plates into `work`, their SVG and CSV into `files`; what an earlier report left there goes first."""
    files.mkdir(exist_ok=True)
    contents = files / CONTENTS
    if contents.is_file():
        for name in read_contents(files)["files"]:
            (files / Path(name).name).unlink(missing_ok=True)
    written = []
    for plate in plates:
        style.save(plate.figure, work / f"{plate.name}.pdf", files / f"{plate.name}.svg")
        written.append(f"{plate.name}.svg")
        for stem, table in plate.data.items():
            table.to_csv(files / f"{stem}.csv", index=False)
            written.append(f"{stem}.csv")
    return written


def _compile(template: str, work: Path) -> bytes:
    """The PDF; set a little tighter where its last page would else hold next to nothing."""
    source = work / f"{template}.typ"
    pdf = _compiled(source, work, 0)
    tight = next((step for step in range(3) if not _empty_end(source, work, step)), 0)
    return _compiled(source, work, tight) if tight else pdf


def _compiled(source: Path, work: Path, tight: int) -> bytes:
    try:
        pdf, warnings = typst.compile_with_warnings(source, root=work, ignore_system_fonts=True,
                                                    sys_inputs={"tight": str(tight)})
    except typst.TypstError as error:
        raise RuntimeError(f"the report template {source.name} does not compile: {error}") from error
    if warnings:
        raise RuntimeError(f"the report template {source.name} compiles with a warning: {warnings[0]}")
    return pdf


def _empty_end(source: Path, work: Path, tight: int) -> bool:
    """Whether the text ends near the top of a page that is not the first."""
    found = typst.query(source, "<end>", field="value", one=True, root=work, ignore_system_fonts=True,
                        sys_inputs={"tight": str(tight)})
    end = json.loads(found)
    return end["page"] > 1 and end["y"] < NEARLY_EMPTY_MM
