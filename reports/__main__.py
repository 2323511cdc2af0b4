"""Command line of `python -m reports`: what is made from the stored results of benchmarks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from matcal.terminal import application, check_out, run

app = application("Reports: the paper walked through, and the stored results of benchmarks.")


@app.callback()
def reports() -> None:
    """Reports: the paper walked through, and the stored results of benchmarks."""


@app.command()
def precision(out: Annotated[Path, typer.Option(help="PDF to write, or the folder to write precision.pdf in.")],
              results: Annotated[Path, typer.Option(help="Folder of the benchmarks' tables.")]
              = Path("benchmarks/results")) -> None:
    """Write a PDF of error against CPU time, and of the cheapest method for a wanted error.

    Example: python -m reports precision --out precision.pdf
    """
    from reports.precision import write

    _write(write, results, out, "precision.pdf")


@app.command()
def stability(out: Annotated[Path, typer.Option(help="PDF to write, or the folder to write stability.pdf in.")],
              results: Annotated[Path, typer.Option(help="Folder of the benchmarks' tables.")]
              = Path("benchmarks/results")) -> None:
    """Write a PDF of stiff and extreme cases: what holds, what holds with a caution and what is lost.

    Example: python -m reports stability --out stability.pdf
    """
    from reports.stability import write

    _write(write, results, out, "stability.pdf")


def _write(write: Callable[[Path, Path], None], results: Path, out: Path, name: str) -> None:
    """Write a report into a PDF, or into `name` in a folder, and say where."""
    place = out / name if out.is_dir() else out
    if place.suffix != ".pdf":
        raise ValueError(f"--out {out}: the file is a PDF; give a name that ends in .pdf, or a folder that exists.")
    check_out(place)
    write(results, place)
    print(f"report: {place}")



if __name__ == "__main__":
    run(app, "python -m reports")
