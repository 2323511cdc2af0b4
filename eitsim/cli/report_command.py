"""The command `eitsim report`: a PDF of one result or of a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from touchcal.terminal import check_out


def report(source: Annotated[Path, typer.Argument(metavar="DIR_OR_RESULT", help="Data set or result.json.")],
           out: Annotated[Path, typer.Option(help="PDF to write.")]) -> None:
    """Write a PDF of one result or of a whole data set.

    Example: eitsim report sweep --out sweep.pdf
    """
    check_out(out)
    check_pdf(out, "--out")
    print(report_written(source, out))


def check_pdf(place: Path | None, flag: str) -> None:
    """ValueError where a file asked for is not named as a PDF."""
    if place is not None and place.suffix != ".pdf":
        raise ValueError(f"{flag} {place}: the file is a PDF; give a name that ends in .pdf.")


def report_written(source: Path, out: Path) -> str:
    """Write the PDF of a result or of a data set; what to tell of it."""
    from reports.sweep.sweep_report import write

    write(source, out)
    return f"report: {out}"
