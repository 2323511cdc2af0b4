"""Command line of `matcal`: inspect, fit, predict, check, export, report."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from matcal.errors import NotConverged
from matcal.terminal import application, counter, numbers, print_json, run

if TYPE_CHECKING:
    from matcal.calibrate import Calibration, Choices
    from matcal.posterior import Posterior

app = application("Calibrate a foam and its conductive skin from test files into a material card.")

CardFile = Annotated[Path, typer.Argument(metavar="CARD", help="Material card (JSON).")]
ColumnsOption = Annotated[list[str] | None, typer.Option(metavar="[KIND=|FILE=]QUANTITY=COLUMN[:UNIT],...", help=(
    "Which columns mean what, where a file does not say: COLUMN is a name or a number from 1; sheet=NAME chooses a "
    "sheet. Repeat it for further files."))]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]


@app.command()
def inspect(files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Machine files or tables.")],
            columns: ColumnsOption = None, as_json: JsonOption = False) -> None:
    """Say what each file holds: its layout, columns, units, range and the kind of test it was taken for.

    Example: matcal inspect data_raw/mts_uniaxial.txt
    """
    from matcal.inspect import describe, print_description
    from matcal.readers.selection import parse_selection, selections_of

    chosen = selections_of([(None, [path]) for path in files], [parse_selection(text) for text in columns or []])
    described = {str(path): describe(path, choice.get(path)) for path, choice in zip(files, chosen, strict=True)}
    if as_json:
        print_json(described)
        return
    for path, found in described.items():
        print_description(path, found)


@app.command()
def fit(files: Annotated[list[str], typer.Argument(metavar="[KIND=]FILE...", help="Test files; conductivity takes "
                                                   "FRAME_FILE,POTENTIOSTAT_FILE.")],
        specimen: Annotated[Path | None, typer.Option(help="Sizes of the specimens (TOML).")] = None,
        columns: ColumnsOption = None,
        branch: Annotated[str, typer.Option(help="Loading of a cyclic test that is used: last (preconditioned) or "
                                            "first.")] = "last",
        order: Annotated[str, typer.Option(help="Terms of the law, 1 to 6, or auto (by BIC).")] = "auto",
        poisson: Annotated[str, typer.Option(help="nu of all terms, one a term A,B,... (increasing alpha), fit (one) "
                                             "or fit-each (needs lateral strain or a volumetric test).")] = "0",
        stable: Annotated[str | None, typer.Option(help="Hold the law drucker or elliptic stable.")] = None,
        stable_range: Annotated[str | None, typer.Option(metavar="LO,HI", help="Principal stretches between which it "
                                                         "is held; by default those that the tests drive.")] = None,
        predicted: Annotated[list[str] | None, typer.Option("--predict", metavar="[KIND=]FILE",
                                                            help="A test to compare with, not to fit.")] = None,
        residual: Annotated[str, typer.Option(help="relative (to each curve's rms), absolute, or deviation (point by "
                                              "point).")] = "relative",
        weight: Annotated[list[str] | None, typer.Option(metavar="KIND=W", help="Weight of a kind.")] = None,
        prony_terms: Annotated[str, typer.Option(help="Terms of the Prony series, 1 to 6, or auto (by BIC).")] = "auto",
        posterior: Annotated[bool, typer.Option("--posterior", help="Sample the posterior with emcee.")] = False,
        seed: Annotated[int, typer.Option(help="Seed of the sampler.")] = 0,
        out: Annotated[Path, typer.Option(help="Card to write; its data go beside it.")] = Path("card.json"),
        report: Annotated[Path | None, typer.Option(help="Write a PDF report here.")] = None,
        as_json: JsonOption = False) -> None:
    """Fit everything the files allow and write the material card.

    Example: matcal fit data_raw/uniaxial.csv data_raw/shear.csv --out card.json
    """
    from matcal.calibrate import Choices, calibrate
    from matcal.card import as_json as card_json
    from matcal.protocols import read_and_reduce
    from matcal.readers.detect import files_of
    from matcal.readers.selection import parse_selection, selections_of
    from matcal.record import folder_of, make_card, write_record
    from matcal.summary import print_fit

    _check_places(folder_of(out), report)
    inputs = [_input(text) for text in files]
    choices = Choices(_order(order), _poisson(poisson), stable, _stretches(stable_range), residual,
                      _weights(weight or []), prony_terms=_terms(prony_terms))
    others = [_input(text) for text in predicted or []]
    chosen = selections_of([*inputs, *others], [parse_selection(text) for text in columns or []])
    reduced = read_and_reduce(inputs, specimen, chosen[:len(inputs)], branch)
    compared = read_and_reduce(others, specimen, chosen[len(inputs):], branch)
    found = calibrate(reduced.experiments, choices, compared.experiments)
    draws, unfinished = _sampled(found, choices, seed) if posterior else (None, None)
    used = [p for _, paths in [*inputs, *others] for path in paths for p in files_of(path)]
    used = list(dict.fromkeys([*used, *reduced.beside, *compared.beside]))
    card = make_card(found, out, used, seed, draws)
    write_record(card, found, out, draws)
    if as_json:
        print_json(card_json(card) | {"card": str(out)})
    else:
        print_fit(card, out)
    if unfinished is not None:
        raise unfinished
    if report is not None:
        _write_report(out, report, quiet=as_json)


def _sampled(found: Calibration, choices: Choices, seed: int) -> tuple[Posterior, NotConverged | None]:
    """The posterior, and the error to raise once it has been saved where it did not converge."""
    from matcal.poisson import FITTED
    from matcal.posterior import MOST_STEPS, sample

    with counter(MOST_STEPS, "posterior") as advance:
        try:
            return sample(found.fit, found.uncertainty, found.prony, found.conductivity, seed, advance,
                          choices.poisson in FITTED), None
        except NotConverged as error:
            return error.estimate, error


@app.command()
def predict(card: CardFile,
            mode: Annotated[str, typer.Argument(metavar="MODE", help="uniaxial, biaxial, planar, shear, volumetric, "
                                                "relaxation or conductivity.")],
            strain: Annotated[str | None, typer.Option(help="Nominal strains A,B,... (gamma in shear, J in "
                                                       "volumetric).")] = None,
            time: Annotated[str | None, typer.Option(help="Times A,B,... in s, for relaxation.")] = None,
            as_json: JsonOption = False) -> None:
    """Print what the card predicts, with its 95 % band where it has a posterior.

    Example: matcal predict card.json uniaxial --strain=-0.1,-0.5,-0.8 --json
    """
    from matcal.card import read_card
    from matcal.prediction import PREDICTED, prediction
    from matcal.summary import print_columns

    if mode not in PREDICTED:
        raise ValueError(f"mode '{mode}' is unknown; known: {', '.join(PREDICTED)}.")
    values = _asked(mode, strain, time)
    columns = prediction(read_card(card), card, mode, values)
    if as_json:
        print_json({"mode": mode, **columns})
    else:
        print_columns(columns, f"{mode}, {card.name}")


@app.command()
def check(card: CardFile, as_json: JsonOption = False) -> None:
    """Print where along each mode the card's law is not Drucker stable or loses ellipticity.

    Example: matcal check card.json
    """
    from matcal.card import read_card, require
    from matcal.data_stability import as_lines
    from matcal.stability import stability
    from matcal.summary import print_stability

    read = read_card(card)
    found = stability(require(read, "hyperfoam", "a stability check"))
    data = read.fit.get("data_stability", [])
    if as_json:
        print_json(found | ({"data": data} if data else {}))
    else:
        print_stability(found)
        for line in as_lines(data):
            print(line)


@app.command()
def export(card: CardFile,
           to: Annotated[str, typer.Option("--to", help="abaqus, calculix, febio, lsdyna or ansys.")],
           moduli: Annotated[str | None, typer.Option(help="instantaneous or longterm; without it as the card holds "
                                                      "them.")] = None,
           units: Annotated[str, typer.Option(help="SI (Pa), mm-t-s (MPa) or mm-kg-ms (GPa).")] = "SI",
           density: Annotated[float | None, typer.Option(help="Mass density, kg/m3; the card holds none.")] = None,
           out: Annotated[Path | None, typer.Option(help="File to write; without it the text is printed.")] = None
           ) -> None:
    """Write the card as material input of a finite-element program; what the program does otherwise is warned of.

    Example: matcal export card.json --to calculix --moduli longterm --units mm-t-s --out foam.inp
    """
    from matcal.card import read_card
    from matcal.export.deck import export as exported

    deck = exported(read_card(card), to, moduli, units, density)
    for warning in deck.warnings:
        print(f"matcal: warning: {warning}", file=sys.stderr)
    if out is None:
        print(deck.text, end="")
    else:
        out.write_text(deck.text, encoding="utf-8")


@app.command()
def report(card: CardFile, out: Annotated[Path, typer.Option(help="PDF to write.")]) -> None:
    """Write the calibration report of a card and its data folder.

    Example: matcal report card.json --out report.pdf
    """
    _write_report(card, out)


def _check_places(folder: Path, report: Path | None) -> None:
    """Before the work begins: a missing folder of the card is made, and said; a report goes into one that is there."""
    if not folder.parent.is_dir():
        folder.parent.mkdir(parents=True)
        print(f"matcal: made the folder {folder.parent}.", file=sys.stderr)
    if report is not None and not report.parent.is_dir():
        raise ValueError(f"--report {report}: the folder {report.parent} does not exist. Create it first.")


def _write_report(card: Path, out: Path, quiet: bool = False) -> None:
    from reports.calibration import write

    write(card, out)
    if not quiet:
        print(f"report: {out}")


def _input(text: str) -> tuple[str | None, tuple[Path, ...]]:
    kind, _, rest = text.rpartition("=") if "=" in text and not Path(text).exists() else ("", "", text)
    return kind or None, tuple(Path(part) for part in (rest.split(",") if not Path(rest).exists() else [rest]))


def _order(text: str) -> int | str:
    if text != "auto" and not text.isdigit():
        raise ValueError(f"--order '{text}' is unknown; give 1 to 6 or auto.")
    return text if text == "auto" else int(text)


def _terms(text: str) -> int | str:
    if text != "auto" and not text.isdigit():
        raise ValueError(f"--prony-terms '{text}' is unknown; give 1 to 6 or auto.")
    return text if text == "auto" else int(text)


def _poisson(text: str) -> float | str | tuple[float, ...]:
    from matcal.poisson import FITTED

    if text in FITTED:
        return text
    values = tuple(numbers(text, "--poisson"))
    return values[0] if len(values) == 1 else values


def _stretches(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    ends = numbers(text, "--stable-range")
    if len(ends) != 2:
        raise ValueError(f"--stable-range '{text}': write two principal stretches LO,HI, for example 0.3,1.5.")
    return ends[0], ends[1]


def _weights(texts: list[str]) -> dict[str, float]:
    out = {}
    for text in texts:
        kind, equals, value = text.partition("=")
        if not equals:
            raise ValueError(f"--weight '{text}': write KIND=W, for example --weight shear=2.")
        out[kind] = numbers(value, f"--weight {kind}")[0]
    return out


def _asked(mode: str, strain: str | None, time: str | None) -> np.ndarray:
    flag, text, other = ("--time", time, strain) if mode == "relaxation" else ("--strain", strain, time)
    if text is None or other is not None:
        raise ValueError(f"{mode} takes {flag} A,B,... and nothing else to evaluate at.")
    return np.array(numbers(text, flag))


def main() -> None:
    """Entry point."""
    run(app, "matcal")
