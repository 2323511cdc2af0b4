"""Command line of `python -m reports`: what is made from the stored results of benchmarks."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchcal.terminal import application, check_out, run

if TYPE_CHECKING:
    from reports.document.page import Report

app = application("""PDFs of more than one result: the source paper walked through, and what the benchmarks measured.

The report of one card, touch, data set or model is written by `matcal report`, `eitsim report` and `surrogate report`.

Example: python -m reports paper""")

# where the walk through the paper is written by default, and where benchmarks write
PAPER, RESULTS = Path("reports/out/paper"), Path("benchmarks/results")
Out = Annotated[Path, typer.Option(help="PDF to write, or a folder that exists to write it in.")]
Results = Annotated[Path, typer.Option(help="Folder of the benchmarks' tables.")]


@app.callback()
def reports() -> None:
    """Reports: the paper walked through, and the stored results of benchmarks."""
    try:
        import_module("benchmarks.report")
    except ModuleNotFoundError:
        raise ValueError("these reports are made in the folder of the source, by what lies in its benchmarks. Run this "
                         "there.") from None


@app.command()
def precision(out: Out, results: Results = RESULTS) -> None:
    """Write a PDF of error against CPU time of every benchmark.

    For a requested error it names the cheapest method and its cost. Nothing is run: tables that are not there, or were
    measured by other code than is here, are said to be so.

    Example: python -m reports precision --out precision.pdf
    """
    from benchmarks.report.precision import report

    _write(report, results, out, "precision.pdf")


@app.command()
def stability(out: Out, results: Results = RESULTS) -> None:
    """Write a PDF of stiff and extreme cases: kept, doubtful or lost.

    Maps of laws, random scenes, relaxation, electrics, and surrogates under noise, from the tables that benchmarks
    wrote; no cell is left out.

    Example: python -m reports stability --out stability.pdf
    """
    from benchmarks.report.stability import report

    _write(report, results, out, "stability.pdf")


@app.command()
def real_skins(out: Out, results: Results = RESULTS) -> None:
    """Write a PDF of touches read on real skins: error and coverage against labels.

    Example: python -m reports real-skins --out real_skins.pdf
    """
    from benchmarks.report.real_skins import report

    _write(report, results, out, "real_skins.pdf")


@app.command()
def pictures(result: Annotated[Path, typer.Argument(help="Result of `eitsim run --out`.")],
             out: Annotated[Path, typer.Option(help="Folder to write touch.png and precision.png in.")]
             = Path("docs/pictures"),
             results: Results = RESULTS) -> None:
    """Draw the two pictures of the README as PNG.

    One is a touch (strain of the skin, and its readings), the other error against run time with peers.

    Example: python -m reports pictures reports/out/touch.json
    """
    from benchmarks.report.readme_pictures import write

    for path in write(result, results, out):
        print(f"picture: {path}")


def _write(report: Callable[[Path], Report], results: Path, out: Path, name: str) -> None:
    """Write a report of stored tables into a PDF, or into `name` in a folder, and say where."""
    from benchmarks.report.stored_tables import write

    place = out / name if out.is_dir() else out
    if place.suffix != ".pdf":
        raise ValueError(f"--out {out}: the file is a PDF; give a name that ends in .pdf, or a folder that exists.")
    check_out(place)
    write(report, results, place)
    print(f"report: {place}")


@app.command()
def paper(out: Annotated[Path, typer.Option(help="Folder of the report; what lies there and is current is kept.")]
          = PAPER,
          full: Annotated[bool, typer.Option("--full", help="4,000 scenes, as the paper has them; up to two "
                                             "hours.")] = False,
          card: Annotated[Path | None, typer.Option(help="Material card that is there, with its folder; else one is "
                                                    "fitted to data_raw/.")] = None,
          sweep: Annotated[Path | None, typer.Option(help="Finished sweep of examples/paper.toml that is there, else "
                                                     "one is made.")] = None,
          workers: Annotated[int, typer.Option(help="Processes of sweep and training.", min=1)] = 2,
          draw_only: Annotated[bool, typer.Option("--draw-only", help="Make no stage; draw what is there, and mark "
                                                  "what is stale or missing.")] = False) -> None:
    """Set the source paper's figures and table next to our own.

    Fits the card, solves touches and a sweep, trains the networks and writes paper.pdf with figures 1, 3 to 19 and
    Table 1 next to what the paper states, its figures (SVG, PNG, CSV) and its numbers: seven CPU minutes, within five
    minutes on two idle cores. It is made from the checkout's data_raw and examples. A run that was stopped goes on
    where it was: stages whose inputs, code and command are the same are kept.

    Example: python -m reports paper --out reports/out/paper

    Example: python -m reports paper --full --card card.json --sweep sweep --out full
    """
    from benchmarks.paper.paper_report import make
    from benchmarks.paper.paper_report import write as write_paper
    from benchmarks.paper.stages_plan import FULL, QUICK, planned
    from eitsim.sweeps.run.folder import sole_writer

    for flag, given, file in (("--card", card, card), ("--sweep", sweep, sweep and sweep / "design.json")):
        if file is not None and not file.is_file():
            raise ValueError(f"{flag} {given}: {file} is not there. Name what matcal fit or eitsim sweep wrote, or "
                             f"leave {flag} out.")
    if out == PAPER:
        PAPER.parent.mkdir(parents=True, exist_ok=True)
    check_out(out, folder=True)
    out.mkdir(exist_ok=True)
    with sole_writer(out, "report"):
        run_of = planned(FULL if full else QUICK, out / "stages", card=card, sweep=sweep, workers=workers)
        if not draw_only:
            make(run_of, out / "stages")
        print(f"report: {write_paper(run_of, out)}")


if __name__ == "__main__":
    run(app, "python -m reports")
