"""Command line of `matcal`: inspect, fit, predict, check, report."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from matcal.errors import NotConverged
from matcal.terminal import application, counter, numbers, print_json, run

if TYPE_CHECKING:
    from matcal.calibrate import Calibration
    from matcal.card import MaterialCard
    from matcal.draws import Draws
    from matcal.posterior import Posterior

app = application("Calibrate a foam and its conductive skin from test files into a material card.")

CardFile = Annotated[Path, typer.Argument(metavar="CARD", help="Material card (JSON).")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
_OTHER_MODES = ("relaxation", "conductivity")


@app.command()
def inspect(files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Machine files or tables.")],
            as_json: JsonOption = False) -> None:
    """Say what each file holds: its layout, columns, units, range and the kind of test it was taken for.

    Example: matcal inspect data_raw/mts_uniaxial.txt
    """
    from matcal.inspect import describe

    described = {str(path): describe(path) for path in files}
    if as_json:
        print_json(described)
        return
    for path, found in described.items():
        print(path)
        for key, value in found.items():
            print(f"  {key}: {value}")


@app.command()
def fit(files: Annotated[list[str], typer.Argument(metavar="[KIND=]FILE...", help="Test files; conductivity takes "
                                                   "FRAME_FILE,POTENTIOSTAT_FILE.")],
        specimen: Annotated[Path | None, typer.Option(help="Sizes of the specimens (TOML).")] = None,
        order: Annotated[str, typer.Option(help="Terms of the law, 1 to 4, or auto (by BIC).")] = "auto",
        poisson: Annotated[str, typer.Option(help="One nu for all terms, or fit.")] = "0",
        stable: Annotated[str | None, typer.Option(help="Hold the law drucker stable where it was fitted.")] = None,
        residual: Annotated[str, typer.Option(help="relative (to each curve's rms), absolute, or deviation (point by "
                                              "point).")] = "relative",
        weight: Annotated[list[str] | None, typer.Option(metavar="KIND=W", help="Weight of a kind.")] = None,
        posterior: Annotated[bool, typer.Option("--posterior", help="Sample the posterior with emcee.")] = False,
        seed: Annotated[int, typer.Option(help="Seed of the sampler.")] = 0,
        out: Annotated[Path, typer.Option(help="Card to write; its data go beside it.")] = Path("card.json"),
        report: Annotated[Path | None, typer.Option(help="Write a PDF report here.")] = None,
        as_json: JsonOption = False) -> None:
    """Fit everything the files allow and write the material card.

    Example: matcal fit data_raw/uniaxial.csv data_raw/shear.csv --out card.json
    """
    from matcal.calibrate import Choices, calibrate
    from matcal.protocols import reduce_tests
    from matcal.record import make_card, write_record

    inputs = [_input(text) for text in files]
    choices = Choices(_order(order), _poisson(poisson), stable, residual, _weights(weight or []))
    found = calibrate(reduce_tests(inputs, specimen), choices)
    draws, unfinished = _sampled(found, seed) if posterior else (None, None)
    used = [p for _, paths in inputs for p in paths] + ([specimen] if specimen else [])
    card = make_card(found, out, used, seed, draws)
    write_record(card, found, out, draws)
    if as_json:
        print_json(_document(card, out))
    else:
        _print_fit(card, found, out)
    if unfinished is not None:
        raise unfinished
    if report is not None:
        _write_report(out, report, quiet=as_json)


def _sampled(found: Calibration, seed: int) -> tuple[Posterior, NotConverged | None]:
    """The posterior, and the error to raise once it has been saved where it did not converge."""
    from matcal.posterior import MOST_STEPS, sample

    if found.fit is None or found.uncertainty is None:
        raise ValueError("--posterior needs a stress-strain curve: give a uniaxial or shear file as well.")
    with counter(MOST_STEPS, "posterior") as advance:
        try:
            return sample(found.fit, found.uncertainty, found.prony, found.conductivity, seed, advance), None
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
    from matcal.modes import MODES

    if mode not in (*MODES, *_OTHER_MODES):
        raise ValueError(f"mode '{mode}' is unknown; known: {', '.join((*MODES, *_OTHER_MODES))}.")
    values = _asked(mode, strain, time)
    columns = _prediction(read_card(card), card, mode, values)
    if as_json:
        print_json({"mode": mode, **columns})
    else:
        _print_columns(columns, f"{mode}, {card.name}")


@app.command()
def check(card: CardFile, as_json: JsonOption = False) -> None:
    """Print where along each mode the card's law is not Drucker stable or loses ellipticity.

    Example: matcal check card.json
    """
    from matcal.card import read_card, require
    from matcal.stability import stability

    found = stability(require(read_card(card), "hyperfoam", "a stability check"))
    if as_json:
        print_json(found)
    else:
        _print_stability(found)


@app.command()
def report(card: CardFile, out: Annotated[Path, typer.Option(help="PDF to write.")]) -> None:
    """Write the calibration report of a card and its data folder.

    Example: matcal report card.json --out report.pdf
    """
    _write_report(card, out)


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
        raise ValueError(f"--order '{text}' is unknown; give 1 to 4 or auto.")
    return text if text == "auto" else int(text)


def _poisson(text: str) -> float | str:
    if text == "fit":
        return text
    return numbers(text, "--poisson")[0]


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


def _prediction(card: MaterialCard, path: Path, mode: str, at: np.ndarray) -> dict[str, Any]:
    """Columns of a prediction: where, the card's value, and the ends of the 95 % band where there are draws."""
    from matcal.card import require

    if mode == "relaxation":
        require(card, "prony", "a relaxation")
        where, name, stem = "time_s", "normalised_stress", "normalised_stress{}"
    elif mode == "conductivity":
        require(card, "conductivity", "a conductivity")
        where, name, stem = "strain", "conductivity_S_per_m", "conductivity{}_S_per_m"
    else:
        require(card, "hyperfoam", "a stress")
        where, name, stem = "strain", "stress_Pa", "stress{}_Pa"
    columns: dict[str, Any] = {where: at, name: _value(card, mode, at)}
    draws = _draws(card, path)
    if draws is not None:
        from matcal.draws import card_of, quantiles

        low, high = quantiles(lambda k: _value(card_of(draws, card, k), mode, at), len(draws))
        columns |= {stem.format("_lo"): low, stem.format("_hi"): high}
    if card.hyperfoam is not None and name == "stress_Pa":
        columns["moduli"] = card.hyperfoam.moduli
    return columns


def _value(card: MaterialCard, mode: str, at: np.ndarray) -> np.ndarray:
    from matcal.conductivity import conductivity
    from matcal.modes import nominal_stress
    from matcal.prony import relaxation

    if mode == "relaxation" and card.prony is not None:
        return relaxation(card.prony, at)
    if mode == "conductivity" and card.conductivity is not None:
        return conductivity(card.conductivity, at)
    assert card.hyperfoam is not None
    return nominal_stress(card.hyperfoam, mode, at)


def _draws(card: MaterialCard, path: Path) -> Draws | None:
    """The card's draws; None without a posterior, or, said on standard error, without its file."""
    if not card.posterior:
        return None
    from matcal.draws import read_draws

    try:
        return read_draws(path)
    except ValueError as error:
        print(f"matcal: no band. {error}", file=sys.stderr)
        return None


def _document(card: MaterialCard, out: Path) -> dict[str, Any]:
    from matcal.card import as_json

    return as_json(card) | {"card": str(out)}


def _print_columns(columns: dict[str, Any], title: str) -> None:
    from rich.console import Console
    from rich.table import Table

    shown = {name: values for name, values in columns.items() if not isinstance(values, str)}
    table = Table(*shown, title=title)
    for row in zip(*shown.values(), strict=True):
        table.add_row(*(f"{value:.6g}" for value in row))
    Console().print(table)
    for name, value in columns.items():
        if isinstance(value, str):
            print(f"{name}: {value}")


def _print_stability(found: dict[str, dict[str, dict[str, Any]]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("criterion", "mode", "stable", "unstable strain", "scanned", title="stability")
    for criterion, modes in found.items():
        for mode, row in modes.items():
            ranges = ", ".join(f"{lo:.4g} to {hi:.4g}" for lo, hi in row["unstable_strain"])
            table.add_row(criterion, mode, "yes" if row["stable"] else "no", ranges or "-",
                          "{:g} to {:g}".format(*row["scanned"]))
    Console().print(table)


def _print_fit(card: MaterialCard, found: Calibration, out: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    for sentence in card.provenance["decisions"]:
        print(f"- {sentence}")
    if "derived" in card.fit:
        table = Table("quantity", "value", "95 % interval", title="what the tests measure")
        for name, row in card.fit["derived"].items():
            table.add_row(name, f"{row['value']:.5g}", f"{row['lo']:.5g} to {row['hi']:.5g}")
        for name, row in card.posterior.get("derived", {}).items():
            table.add_row(f"{name} (posterior)", f"{row['median']:.5g}", f"{row['lo']:.5g} to {row['hi']:.5g}")
        console.print(table)
    console.print(_error_table(card))
    if "parameters" in card.fit:
        console.print(_parameter_table(card))
    if card.posterior:
        checks = card.posterior["checks"]
        print(f"posterior: R-hat {checks['rhat']:.3f}, effective sample size {checks['ess']:.0f}, autocorrelation "
              f"{checks['autocorrelation_steps']:.0f} of {checks['steps_kept']:.0f} steps. Prior: "
              f"{card.posterior['prior']}")
    print("CPU: " + ", ".join(f"{stage} {spent:.2f} s" for stage, spent in card.provenance["cpu_s"].items()) + ".")
    print(f"card: {out} (sha256 {hashlib.sha256(out.read_bytes()).hexdigest()[:12]}), data: {out.with_suffix('.d')}")


def _error_table(card: MaterialCard) -> Any:
    from rich.table import Table

    table = Table("test", "points", "rms", "relative RMS", "R2", "weight", "alone, others", title="errors")
    cross = card.fit.get("cross_prediction", {})
    for label, row in card.fit.items():
        if isinstance(row, dict) and "kind" in row and "rms" in row:
            alone = cross.get(row["kind"], {}).get("relative_rms", {})
            table.add_row(label, str(row["n"]), f"{row['rms']:.4g} {row['unit']}", f"{row['relative_rms']:.3%}",
                          f"{row['r2']:.6f}", f"{row['weight']:.2f}",
                          ", ".join(f"{m} {v:.2%}" if v < 10 else f"{m} over 1000%" for m, v in alone.items()))
    return table


def _parameter_table(card: MaterialCard) -> Any:
    from rich.table import Table

    table = Table("parameter", "value", "standard error (lmfit)", title="parameters, not all of them measurable alone")
    for name, row in card.fit["parameters"].items():
        table.add_row(name, f"{row['value']:.5g}", "none" if row["stderr"] is None else f"{row['stderr']:.2g}")
    if card.prony is not None:
        for k, (g, tau) in enumerate(zip(card.prony.g, card.prony.tau_s, strict=True)):
            sd = card.fit["prony"]
            table.add_row(f"g_{k + 1}", f"{g:.4f}", f"{sd['g_sd'][k]:.2g}")
            table.add_row(f"tau_{k + 1}_s", f"{tau:.4g}", f"{sd['tau_sd_s'][k]:.2g}")
    if card.conductivity is not None:
        table.add_row("c0_S_per_m", f"{card.conductivity.c0_S_per_m:.5g}", "")
        for k, a in enumerate(card.conductivity.a, 1):
            table.add_row(f"a_{k}", f"{a:.4g}", "")
    return table


def main() -> None:
    """Entry point."""
    run(app, "matcal")
