"""What the command line prints of a calibration: results first, what to mind, errors; decisions if asked for."""

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from matcal.card import MaterialCard, grouped
from matcal.fitting.hyperfoam.record_stability import as_lines
from matcal.laws.deformation_modes import MODES
from matcal.laws.law import expanded, vector
from matcal.record import result_tables as tables
from matcal.record.cautions import cautions, tests
from matcal.record.exporters.programs import targets
from touchcal.errors import InputFileError
from touchcal.number_words import counted
from touchcal.terminal import foremost, print_json

# columns of a table in a pipe, where nothing says how wide the reader's page is
_PIPE = 120
# rubber laws of most weight that are shown, where all are not asked for
_LAWS = 3


def print_columns(columns: dict[str, Any], title: str) -> None:
    """Print columns of one length as a table, and words below it."""
    shown = {name: values for name, values in columns.items() if not isinstance(values, str)}
    rows = [[f"{value:.6g}" for value in row] for row in zip(*shown.values(), strict=True)]
    console = _console()
    _print_table(console, tables.Printed(title, [*shown], rows, ">" * len(shown)))
    for name, value in columns.items():
        if isinstance(value, str):
            _say(console, f"{name}: {value}")


def print_followed(card: MaterialCard, mode: str, history: Path, others: list[str], as_json: bool) -> None:
    """Print the stress along the path of a file; ValueError where something else to evaluate at is given too."""
    from matcal.readers.detect import read
    from matcal.record.predict import follow_path

    if others:
        raise ValueError(f"--history is what a prediction is evaluated at; leave {', '.join(others)} out.")
    columns = read(history).columns
    if not {"strain", "stretch"} & set(columns):
        raise InputFileError(history, "a path needs a column of strain, next to one of time. Name it strain.")
    strain = columns["strain"] if "strain" in columns else columns["stretch"] - 1
    found = follow_path(card, mode, strain, columns.get("time"))
    if as_json:
        print_json({"mode": mode, **found})
    else:
        print_columns(found, f"{mode} along {history.name}, {card.name}")


def print_stability(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> None:
    """Print the ranges that `matcal.laws.stability.stability` found."""
    _print_table(_console(), tables.stability(found))


def print_fit(card: MaterialCard, out: Path, *, verbose: bool = False) -> None:
    """Print what a calibration found, from its card, and what may be done with it next; verbose: stability, orders and
    what was decided as well."""
    console = _console()
    _say(console, _title(card))
    for table in _results(card, verbose):
        _print_table(console, table)
    shown, more = foremost(cautions(card), verbose)
    if shown:
        _heading(console, "Mind")
        for sentence in shown:
            _item(console, "!", sentence)
    quality = list(_quality(card))
    for table in quality if verbose else quality[:1]:
        _print_table(console, table)
    if card.posterior:
        _say(console, f"\nPosterior: {_posterior(card, verbose)}")
    if verbose:
        _heading(console, "Decisions")
        _decisions(console, card)
    _heading(console, "Next")
    for command, purpose in _next(card, out):
        _say(console, f"  {command}   {purpose}")
    if verbose:
        spent = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in card.provenance["cpu_s"].items())
        _say(console, f"\nCPU: {spent}.")
    else:
        decisions = sum(len(sentences) for _, sentences in grouped(card))
        tables_left = len(quality[1:]) + len([*_results(card, True)]) - len([*_results(card, False)])
        left = ", ".join(filter(None, (more, counted(decisions, "decision"),
                                       counted(tables_left, "more table") if tables_left else "")))
        _say(console, f"\n{left}: with --verbose, or in the card and its report")
    _say(console, f"card: {out} (file sha256 {hashlib.sha256(out.read_bytes()).hexdigest()[:12]}), "
                  f"data: {out.with_suffix('.d')}")


def print_imported(card: MaterialCard, out: Path) -> None:
    """Print the law that a deck gave, what was assumed and left out, and what may be done with the card next."""
    console, law = _console(), card.law
    assert law is not None
    values = dict(zip((name for _, name in expanded(law)), vector(law), strict=True))
    _say(console, f"{card.name}: {law.name}, {law.moduli.replace('longterm', 'long-term')} moduli, mu_0 = "
                  f"{law.mu_0_Pa:.6g} Pa")
    _say(console, "  " + ", ".join(f"{name} = {value:.6g}" for name, value in values.items()))
    for table in _results(card):
        _print_table(console, table)
    _heading(console, "Decisions")
    for sentence in card.provenance["decisions"]:
        _item(console, "-", sentence)
    _heading(console, "Next")
    for command, purpose in _next(card, out)[1:]:
        _say(console, f"  {command}\n      {purpose}")
    _say(console, f"\ncard: {out}")


def _results(card: MaterialCard, verbose: bool = True) -> Iterator[tables.Printed]:
    """Tables of results; what the first one says already, and single terms that compensate each other, where
    verbose."""
    several = "derived" in card.fit and (card.prony is not None or card.conductivity is not None)
    compared = bool(card.fit.get("laws"))
    if "derived" in card.fit or card.posterior.get("derived"):
        yield tables.derived(card)
    if card.law is not None and "parameters" in card.fit and (
            verbose or not (several if card.hyperfoam is not None else compared)):
        yield tables.law(card)
    if card.softening is not None:
        yield tables.softening(card)
    if compared:
        yield tables.laws(card, None if verbose else _LAWS)
    if card.prony is not None and (verbose or not several):
        yield tables.series(card)
    if card.conductivity is not None and (verbose or not several):
        yield tables.skin(card)


def _quality(card: MaterialCard) -> Iterator[tables.Printed]:
    fitted = tests(card)
    if fitted:
        yield tables.errors(card)
    if any("stiffness_factor" in row for row in fitted.values()):
        yield tables.replicates(card)
    if "next_specimen" in card.fit:
        yield tables.next_specimen(card)
    if card.fit.get("cross_prediction"):
        yield tables.cross(card)
        if len({row["kind"] for row in fitted.values()}) < len(fitted):
            yield tables.by_test(card)
    if card.fit.get("predicted"):
        yield tables.predicted(card)
    if "without_stability" in card.fit:
        yield tables.stability_cost(card)
    if card.stability:
        found = tables.stability(card.stability)
        yield replace(found, notes=(*found.notes, *as_lines(card.fit.get("data_stability", ()))))
    if len(card.fit.get("orders", ())) > 1:
        yield tables.orders(card)
    if len(card.fit.get("prony", {}).get("orders", ())) > 1:
        yield tables.series_orders(card)


def _title(card: MaterialCard) -> str:
    fitted = tests(card).values()
    sources, many = {name for row in fitted for name in row["source"]}, len(fitted)
    files = sum(file["name"] in sources for file in card.provenance.get("files", ()))
    decided = card.fit.get("material", {}).get("decided", True)
    body = card.law.body if card.law is not None and decided else "foam or rubber"
    parts = [name for part, name in (("law", body), ("prony", "relaxation"), ("conductivity", "skin"))
             if getattr(card, part) is not None]
    of = " of synthetic data" if card.provenance.get("synthetic") else ""
    return (f"{card.name}: {', '.join(parts) or 'nothing'}, from {many} test{'s' * (many != 1)} in {files} "
            f"file{'s' * (files != 1)}{of}")


def _posterior(card: MaterialCard, verbose: bool) -> str:
    checks = card.posterior["checks"]
    state = "converged" if checks.get("converged", True) else "did NOT converge"
    words = (f"{card.posterior['n']} draws, {state}: R-hat {checks['rhat']:.3f}, effective sample size "
             f"{checks['ess']:.0f}")
    return words if not verbose else (
        f"{words}, autocorrelation time {checks['autocorrelation_steps']:.0f} of {checks['steps_kept']:.0f} steps. "
        f"Prior: {card.posterior['prior']}")


def _decisions(console: Console, card: MaterialCard) -> None:
    for title, sentences in grouped(card):
        console.print(Text(title, style="bold"), soft_wrap=True)
        for sentence in sentences:
            _item(console, "-", sentence)


def _next(card: MaterialCard, out: Path) -> list[tuple[str, str]]:
    said = [(f"matcal report {out} --out {out.with_suffix('.pdf')}", "figures, tables and provenance as PDF")]
    if card.law is not None:
        mode = next((m for m in MODES if m in card.law.strain_range), "uniaxial")
        at = card.law.strain_range.get(mode, (-0.5, 0.0))
        strain = 0.5 * (at[0] if abs(at[0]) > abs(at[1]) else at[1])
        said += [(f"matcal check {out}", "where the law is stable"),
                 (f"matcal predict {out} {mode} --strain={strain:.2g}",
                  "stress, with its band" if card.posterior or card.fit.get("laws") else
                  "stress; after --posterior with its band"),
                 (f"matcal export {out} --to {targets()[0]}", f"or {', '.join(targets()[1:])}")]
    elif card.prony is not None:
        said.append((f"matcal predict {out} relaxation --time=1,10,100", "normalised stress"))
    elif card.conductivity is not None:
        said.append((f"matcal predict {out} conductivity --strain=-0.2,0.2", "conductivity, with its band"))
    return said


def _console() -> Console:
    """The terminal as it is, or COLUMNS wide; in a pipe wide enough that no table is folded."""
    console = Console()
    return console if console.is_terminal or "COLUMNS" in os.environ else Console(width=_PIPE)


def print_table(printed: tables.Printed) -> None:
    """One table by itself."""
    _print_table(_console(), printed)


def _print_table(console: Console, printed: tables.Printed) -> None:
    _heading(console, printed.title)
    wide, without = console.options.update(width=1000), 0
    while without < len(printed.spare) and console.measure(
            _table(printed, printed.spare[:without]), options=wide).maximum > console.width:
        without += 1
    console.print(_table(printed, printed.spare[:without]))
    for note in printed.notes:
        _say(console, f" {note}")


def _table(printed: tables.Printed, without: Sequence[str]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1), header_style="")
    kept = [k for k, head in enumerate(printed.head) if head not in without]
    for k in kept:
        align = printed.align[k]
        table.add_column(printed.head[k], justify="right" if align == ">" else "left", no_wrap=align != "w",
                         overflow="fold")
    for row in printed.rows:
        table.add_row(*(Text(row[k]) for k in kept))
    return table


def _heading(console: Console, words: str) -> None:
    console.print()
    console.print(Text(words, style="bold"))


def _item(console: Console, mark: str, sentence: str) -> None:
    """A sentence behind its mark: wrapped with a hanging indent on a terminal, one line in a pipe."""
    if not console.is_terminal:
        _say(console, f"  {mark} {sentence}")
        return
    grid = Table.grid(padding=(0, 1))
    grid.add_row(mark, Text(sentence))
    console.print(Padding(grid, (0, 0, 0, 2)))


def _say(console: Console, words: str) -> None:
    """Plain words; a pipe gets them in one line."""
    console.print(Text(words), soft_wrap=not console.is_terminal)


