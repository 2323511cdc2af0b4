"""What the command line prints: decisions, results with their errors, predictions, stability."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from matcal.card import MaterialCard


def print_columns(columns: dict[str, Any], title: str) -> None:
    """Print columns of one length as a table, and words below it."""
    shown = {name: values for name, values in columns.items() if not isinstance(values, str)}
    table = Table(*shown, title=title)
    for row in zip(*shown.values(), strict=True):
        table.add_row(*(f"{value:.6g}" for value in row))
    Console().print(table)
    for name, value in columns.items():
        if isinstance(value, str):
            print(f"{name}: {value}")


def print_stability(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> None:
    """Print the ranges that `matcal.stability.stability` found."""
    table = Table("criterion", "mode", "stable", "unstable strain", "scanned", title="stability")
    for criterion, modes in found.items():
        for mode, row in modes.items():
            ranges = ", ".join(f"{lo:.4g} to {hi:.4g}" for lo, hi in row["unstable_strain"])
            table.add_row(criterion, mode, "yes" if row["stable"] else "no", ranges or "-",
                          "{:g} to {:g}".format(*row["scanned"]))
    Console().print(table)


def print_fit(card: MaterialCard, out: Path) -> None:
    """Print what a calibration decided and found, from its card, and where the card went."""
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
    if cross := card.fit.get("cross_prediction"):
        console.print(_cross_table(cross))
    if "parameters" in card.fit:
        console.print(_parameter_table(card))
    if card.posterior:
        checks = card.posterior["checks"]
        print(f"posterior: R-hat {checks['rhat']:.3f}, effective sample size {checks['ess']:.0f}, autocorrelation "
              f"{checks['autocorrelation_steps']:.0f} of {checks['steps_kept']:.0f} steps. Prior: "
              f"{card.posterior['prior']}")
    if card.provenance.get("synthetic"):
        print("The data are synthetic, by the files' own words: nothing here was measured.")
    print("CPU: " + ", ".join(f"{stage} {spent:.2f} s" for stage, spent in card.provenance["cpu_s"].items()) + ".")
    print(f"card: {out} (sha256 {hashlib.sha256(out.read_bytes()).hexdigest()[:12]}), data: {out.with_suffix('.d')}")


def _error_table(card: MaterialCard) -> Table:
    table = Table("test", "points", "rms", "relative RMS", "R2", "weight", title="errors of the combined fit")
    for label, row in card.fit.items():
        if isinstance(row, dict) and "kind" in row and "rms" in row:
            table.add_row(label, str(row["n"]), f"{row['rms']:.4g} {row['unit']}", f"{row['relative_rms']:.3%}",
                          "-" if row["r2"] is None else f"{row['r2']:.6f}", f"{row['weight']:.2f}")
    return table


def _cross_table(cross: Mapping[str, Any]) -> Table:
    table = Table("fitted to", *(f"predicts {mode}" for mode in cross), title="relative RMS of laws fitted to one mode")
    for mode, law in cross.items():
        errors = law["relative_rms"]
        table.add_row(f"{mode} alone", *(f"{errors[m]:.2%}" if errors[m] < 10 else "over 1000%" for m in cross))
    return table


def _parameter_table(card: MaterialCard) -> Table:
    table = Table("parameter", "value", "standard error (lmfit)", title="parameters, not all of them measurable alone")
    for name, row in card.fit["parameters"].items():
        if name == "mu_0_Pa":
            continue  # its honest interval stands above: lmfit's error leaves contact, drift and misfit out
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
