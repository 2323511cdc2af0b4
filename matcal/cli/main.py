"""Command line of `matcal`: inspect, fit, predict, next, check, export, import, compare, report."""

import sys
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from matcal.laws.conduction_laws import LAWS as CONDUCTION
from matcal.laws.known_laws import LAWS
from matcal.record.exporters.programs import targets
from touchcal.errors import InputFileError, NotConverged
from touchcal.lazy import install, installed
from touchcal.terminal import JsonOption, SeedOption, application, check_apart, check_out, counter, print_json, run

app = application("Calibrate a foam and its conductive skin from test files into a material card.")

CardFile = Annotated[Path, typer.Argument(metavar="CARD", help="Material card (JSON).")]
ColumnsOption = Annotated[list[str] | None, typer.Option(metavar="[KIND=|FILE=]QUANTITY=COLUMN[:UNIT],...", help=(
    "Which columns mean what, where a file does not say: COLUMN is a name or a number from 1; sheet=NAME chooses a "
    "sheet, block=N a block of an MTS 793 file. Repeat it for further files."))]


@app.command("inspect")
def inspect_command(
        files: Annotated[list[str], typer.Argument(metavar="[KIND=]FILE...", help="Machine files or tables.")],
        columns: ColumnsOption = None, as_json: JsonOption = False) -> None:
    """Say what each file holds: its layout, columns, units, range and the kind of test it was taken for.

    Example: matcal inspect data_raw/mts_uniaxial.txt
    """
    from matcal.readers.column_options import parse_selection, selections_of
    from matcal.readers.test_inputs import files_named
    from matcal.reduction.inspect import inspect, print_description

    inputs = [files_named(text) for text in files]
    chosen = selections_of(inputs, [parse_selection(text) for text in columns or []])
    described, errors = {}, []
    for path, kind, choice in ((path, kind, choice.get(path)) for (kind, paths), choice
                               in zip(inputs, chosen, strict=True) for path in paths):
        try:
            described[str(path)] = inspect(path, choice, kind)
        except InputFileError as error:
            errors.append(error)
    if as_json and described:
        print_json(described)
    for path, found in () if as_json else described.items():
        print_description(path, found)
    sys.stdout.flush()
    for error in errors[:-1]:
        print(f"matcal: {error}", file=sys.stderr)
    if errors:
        raise errors[-1]


@app.command("fit")
def fit_command(
        files: Annotated[list[str], typer.Argument(metavar="[KIND=]FILE...", help="Test files; conductivity takes "
                                                   "FRAME_FILE,POTENTIOSTAT_FILE.")],
        specimen: Annotated[Path | None, typer.Option(help="Sizes of the specimens in mm (TOML).")] = None,
        columns: ColumnsOption = None,
        branch: Annotated[str, typer.Option(help="Which loading of a cyclic test counts: last (preconditioned) "
                                            "or first.")] = "last",
        unloading: Annotated[bool, typer.Option("--unloading", help="Fit all loadings and unloadings of cyclic tests: "
                                                "the law of the first loading, its softening, set and loop.")] = False,
        law: Annotated[str, typer.Option(help=f"Law: {', '.join(LAWS)}; or auto: hyperfoam for a "
                                            "foam, else the rubber law that predicts best.")] = "hyperfoam",
        order: Annotated[str, typer.Option(help="Terms of the law, 1 to 6, or auto (by BIC).")] = "auto",
        poisson: Annotated[str | None, typer.Option(
            help="Poisson-like nu: a value for all terms, or A,B,... one a term (by increasing alpha); fit: one for "
                 "all terms from lateral strain, a volumetric test, or two modes at least (from stress, less sure); "
                 "fit-each: one a term, from lateral strain or a volumetric test. Without it a foam's 0.")] = None,
        stable: Annotated[str | None, typer.Option(help="Fit the best stable law: drucker or elliptic.")] = None,
        stable_range: Annotated[str | None, typer.Option(metavar="LO,HI", help="With --stable: principal stretches "
                                                         "between which the law is stable; by default those of the "
                                                         "tests.")] = None,
        predicted: Annotated[list[str] | None, typer.Option("--predict", metavar="[KIND=]FILE",
                                                            help="Test that is compared with the fit and not part of "
                                                                 "it.")] = None,
        residual: Annotated[str, typer.Option(help="What a residual is divided by: relative (the curve's rms), "
                                              "absolute (nothing), or deviation (each point's own).")] = "relative",
        weight: Annotated[list[str] | None, typer.Option(metavar="KIND=W", help="Weight of one kind of test, for "
                                                         "instance shear=2.")] = None,
        prony_terms: Annotated[str, typer.Option(help="Terms of the Prony series, 1 to 30, or auto (BIC).")] = "auto",
        prony_times: Annotated[str | None, typer.Option(metavar="A,B,...|FROM:TO:COUNT", help=(
            "Relaxation times in s that are not fitted, or COUNT of them evenly in log time."))] = None,
        reference_temperature: Annotated[float | None, typer.Option(metavar="C", help=(
            "Temperature in C of the series of a dynamic test at several; the sweep nearest to it, or to 20 C, "
            "counts."))] = None,
        conduction: Annotated[str, typer.Option(help=f"Law of the skin: {', '.join(CONDUCTION)}; or auto: cubic, or "
                                                "what predicts best where the cubic is twice as far off.")] = "auto",
        strain_zero: Annotated[float, typer.Option(metavar="SD", help="Standard deviation of the strain zero of tests "
                                                   "that do not state one, for instance 0.002 for tables; it is then "
                                                   "in the intervals.")] = 0.0,
        posterior: Annotated[bool, typer.Option("--posterior", help="Sample the posterior with emcee.")] = False,
        seed: SeedOption = 0,
        out: Annotated[Path, typer.Option(help="Card to write; its data go next to it.")] = Path("card.json"),
        report: Annotated[Path | None, typer.Option(help="Write a PDF report here.")] = None,
        verbose: Annotated[bool, typer.Option("--verbose", help="Also print stability, the orders tried and every "
                                              "decision.")] = False,
        as_json: JsonOption = False) -> None:
    """Fit everything the files allow and write the material card.

    Example: matcal fit data_raw/uniaxial.csv data_raw/shear.csv --out card.json
    """
    from matcal.card import as_json as card_json
    from matcal.cli.arguments import fit_options
    from matcal.cli.summary import print_fit
    from matcal.record.calibration import Calibration, fit

    _check_places(out, report, [*files, *(predicted or [])], specimen)
    options = fit_options(order, poisson, stable, stable_range, residual, weight or [], prony_terms,
                          strain_zero, law, prony_times, reference_temperature, conduction)
    unfinished = None
    warnings.filterwarnings("ignore", "\nArviZ is undergoing", FutureWarning)  # arviz says so once a day
    with _counted(posterior) as progress:
        try:
            found = fit(files, specimen, options=options, predicted=predicted or (), columns=columns or (),
                        branch="all" if unloading else branch, posterior=posterior, seed=seed, progress=progress)
        except NotConverged as error:
            if not isinstance(error.estimate, Calibration):
                raise
            found, unfinished = error.estimate, error
    card = found.save(out).card
    if not installed("pyarrow"):
        print(f"matcal: {card.data} has no tables of the tests, for which pyarrow is not installed; "
              f"{install('pyarrow')}", file=sys.stderr)
    if as_json:
        print_json(card_json(card) | {"card": str(out)})
    else:
        print_fit(card, out, verbose=verbose)
    if unfinished is not None:
        raise unfinished
    if report is not None:
        _write_report(out, report, quiet=as_json)


def _counted(posterior: bool) -> AbstractContextManager[Callable[[int], None] | None]:
    """What shows the steps of the sampler; None where nothing is sampled."""
    if not posterior:
        return nullcontext()
    from matcal.posterior.ensembles import MOST_STEPS

    return counter(MOST_STEPS, "posterior")


@app.command("predict")
def predict_command(
        card: CardFile,
        mode: Annotated[str, typer.Argument(metavar="MODE", help="uniaxial, biaxial, planar, shear, volumetric, "
                                            "relaxation or conductivity.")],
        strain: Annotated[str | None, typer.Option(help="Nominal strains A,B,... (gamma in shear, J in volumetric); "
                                                   "without it over those that were fitted.")] = None,
        time: Annotated[str | None, typer.Option(help="Times A,B,... in s, for relaxation; without it over the "
                                                 "series.")] = None,
        temperature: Annotated[float | None, typer.Option(metavar="C", help="Temperature of a relaxation in C, by the "
                                                          "shift of the card.")] = None,
        history: Annotated[Path | None, typer.Option(help="File of a path to follow, with columns of strain and time "
                                                     "(a table or a machine file).")] = None,
        as_json: JsonOption = False) -> None:
    """Print what the card predicts, with its 95 % band where it has a posterior or
    several laws were compared.

    Example: matcal predict card.json uniaxial --strain=-0.1,-0.5,-0.8 --json
    """
    from matcal.card import read_card
    from matcal.cli.arguments import points
    from matcal.cli.summary import print_columns, print_followed
    from matcal.record.predict import beyond, predict

    read = read_card(card)
    if history is not None:
        print_followed(read, mode, history, [flag for flag, value in (("--strain", strain), ("--time", time))
                                             if value is not None], as_json)
        return
    columns = predict(read, mode, points(read, mode, strain, time), temperature_C=temperature)
    for sentence in beyond(read, mode, columns):
        print(f"matcal: warning: {sentence}", file=sys.stderr)
    if as_json:
        print_json({"mode": mode, **columns})
    else:
        print_columns(columns, f"{mode}, {card.name}")
        if "moduli" in columns and read.prony is not None:
            print(f"instantaneous over long-term stress: {1 / read.prony.g_infinity:.6g}")


@app.command("next")
def next_command(
        card: CardFile,
        quantity: Annotated[str, typer.Option("--for", metavar="QUANTITY", help=(
            "What is to be narrowed: mu_0, E_0, plateau, g_infinity, mu_0_instantaneous, nu, or "
            "stress:MODE:STRAIN, or touch:SCENE, the depth of a touch."))] = "mu_0",
        minutes: Annotated[list[str] | None, typer.Option(metavar="KIND=MIN,...", help=(
            "What a test of a kind takes; tests are then in the order of what they narrow a minute, and other kinds "
            "are left out."))] = None,
        as_json: JsonOption = False) -> None:
    """Say which further test would narrow a quantity most, by what the card leaves open.

    Example: matcal next card.json --for stress:biaxial:0.5 --minutes uniaxial=15,biaxial=60
    """
    from matcal.card import read_card
    from matcal.cli import next_command as shown
    from matcal.cli.summary import print_table
    from matcal.record.next_test.next_tests import next_tests

    read = read_card(card)
    found = next_tests(read, quantity, minutes=shown.minutes_of(minutes))
    if as_json:
        print_json(shown.as_json(found))
    else:
        print_table(shown.table(found, read))


@app.command("check")
def check_command(card: CardFile, as_json: JsonOption = False) -> None:
    """Print where along each mode the card's law is not Drucker stable or loses ellipticity.

    Example: matcal check card.json
    """
    from matcal.cli.summary import print_stability
    from matcal.fitting.hyperfoam.record_stability import as_lines
    from matcal.record.predict import check

    found = check(card)
    if as_json:
        print_json(found)
        return
    data = found.pop("data", ())
    print_stability(found)
    for line in as_lines(data):
        print(line)


@app.command("export")
def export_command(
        card: CardFile,
        to: Annotated[str, typer.Option("--to", help=f"{', '.join(targets()[:-1])} or {targets()[-1]}.")],
        moduli: Annotated[str | None, typer.Option(help="instantaneous or longterm; without it as the card holds "
                                                   "them.")] = None,
        units: Annotated[str, typer.Option(help="SI (Pa), mm-t-s (MPa) or mm-kg-ms (GPa).")] = "SI",
        density: Annotated[float | None, typer.Option(help="Mass density, kg/m3 whatever the units written; the card "
                                                      "holds none.")] = None,
        out: Annotated[Path | None, typer.Option(help="File to write; without it the text is printed.")] = None
        ) -> None:
    """Write the card as material input of a finite-element program; what the program does otherwise is warned of.

    Example: matcal export card.json --to calculix --moduli longterm --units mm-t-s --out foam.inp
    """
    from matcal.record.exporters.deck import export

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [card])
    deck = export(card, to.lower(), moduli, units, density)
    for warning in deck.warnings:
        print(f"matcal: warning: {warning}", file=sys.stderr)
    if out is None:
        print(deck.text, end="")
    else:
        out.write_text(deck.text, encoding="utf-8")
        print(f"deck: {out}")


@app.command("import")
def import_command(
        deck: Annotated[Path, typer.Argument(metavar="DECK", help="Material input of Abaqus, Ansys or LS-DYNA.")],
        program: Annotated[str | None, typer.Option("--from", help="abaqus (CalculiX too), ansys or lsdyna; without it "
                                                    "by the deck's keywords.")] = None,
        units: Annotated[str | None, typer.Option(help="Units of the deck: SI (Pa), mm-t-s (MPa) or mm-kg-ms (GPa); "
                                                  "without it SI.")] = None,
        material: Annotated[str | None, typer.Option(help="Name or number of the material, where several have a "
                                                     "law.")] = None,
        out: Annotated[Path, typer.Option(help="Card to write.")] = Path("card.json"),
        as_json: JsonOption = False) -> None:
    """Read the law of a deck, its relaxation, shift and softening, into a material card.

    Example: matcal import silicone.inp --from abaqus --units mm-t-s --out silicone.json
    """
    from matcal.card import as_json as card_json
    from matcal.card import write_card
    from matcal.cli.summary import print_imported
    from matcal.record.importers.read_deck import import_deck

    check_out(out)
    check_apart({"--out": out}, [deck])
    card = import_deck(deck, program and program.lower(), units, material)
    write_card(card, out)
    if as_json:
        print_json(card_json(card) | {"card": str(out)})
    else:
        print_imported(card, out)


@app.command("compare")
def compare_command(
        first: Annotated[Path, typer.Argument(metavar="A", help="Material card (JSON).")],
        second: Annotated[Path, typer.Argument(metavar="B", help="Another card.")],
        out: Annotated[Path | None, typer.Option(help="PDF to write, with the curves over each other.")] = None,
        as_json: JsonOption = False) -> None:
    """Print how two cards differ, in standard deviations, and draw them over each other.

    Example: matcal compare a.json b.json --out compare.pdf
    """
    from matcal.card import read_card
    from matcal.cli.summary import print_table
    from matcal.record.compare import differences, names_of, table

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [first, second])
    found = differences(read_card(first), read_card(second))
    if as_json:
        print_json([asdict(one) for one in found])
    else:
        print_table(table(found, names_of(first, second)))
    if out is not None:
        from reports.calibration.comparison import write

        write(first, second, out)
        if not as_json:
            print(f"report: {out}")


@app.command()
def report(card: CardFile, out: Annotated[Path, typer.Option(help="PDF to write.")]) -> None:
    """Write the calibration report of a card and its data folder.

    Example: matcal report card.json --out report.pdf
    """
    check_out(out)
    check_apart({"--out": out}, [card])
    _write_report(card, out)


def _check_places(out: Path, report: Path | None, tests: list[str], specimen: Path | None) -> None:
    """Before the work begins: card, its folder and report can be written, and nothing but an earlier fit goes."""
    from matcal.readers.test_inputs import files_named
    from matcal.record.write import check_place, folder_of

    inputs = [path for test in tests for path in files_named(test)[1]] + ([specimen] if specimen else [])
    check_out(out)
    check_out(folder_of(out), folder=True)
    check_place(out, inputs)
    if report is not None:
        check_out(report, "--report")
        check_apart({"--out": out, "--report": report}, inputs)


def _write_report(card: Path, out: Path, quiet: bool = False) -> None:
    from reports.calibration.calibration_report import write

    write(card, out)
    if not quiet:
        print(f"report: {out}")


def main() -> None:
    """Entry point."""
    run(app, "matcal", {"weights": "--weight", "strain_zero_sd": "--strain-zero"})
