"""The simulation report: one touch from its `result.json`, or a whole data set from its folder."""

from __future__ import annotations

from pathlib import Path

from reports.document.page import write_pdf
from reports.document.style import house
from reports.sweep import sweep_report
from reports.touch import touch_report


def write(source: Path, out: Path) -> None:
    """Write the PDF of a result of `eitsim run` (a JSON file) or of a data set of `eitsim sweep` (a folder).

    InputFileError where `source` is neither; ValueError where the folder of `out` is missing.
    """
    with house():
        report = sweep_report.report(source) if source.is_dir() else touch_report.report(source)
        write_pdf(report, out)
