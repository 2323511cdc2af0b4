"""Command line of `python -m reports`: what is made from the stored results of benchmarks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from matcal.terminal import application, check_out, run

app = application("Reports from the stored results of benchmarks: precision.")


@app.callback()
def reports() -> None:
    """Reports from the stored results of benchmarks."""


@app.command()
def precision(out: Annotated[Path, typer.Option(help="PDF to write, or the folder to write precision.pdf in.")],
              results: Annotated[Path, typer.Option(help="Folder of the benchmarks' tables.")]
              = Path("benchmarks/results")) -> None:
    """Write a PDF of error against CPU time, and of the cheapest method for a wanted error.

    Example: python -m reports precision --out precision.pdf
    """
    from reports.precision import write

    place = out / "precision.pdf" if out.is_dir() else out
    if place.suffix != ".pdf":
        raise ValueError(f"--out {out}: the file is a PDF; give a name that ends in .pdf, or a folder that exists.")
    check_out(place)
    write(results, place)
    print(f"report: {place}")


if __name__ == "__main__":
    run(app, "python -m reports")
