"""What the command line prints of scores: one table of unseen rows, what to mind, what next; else everything."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from touchcal.terminal import foremost, print_table

if TYPE_CHECKING:
    from surrogate.model.sweep_model import SweepModel


def print_scores(result: Mapping[str, Any], *, verbose: bool = False, more: Iterable[str] = (),
                 over_first: Mapping[str, float | None] | None = None) -> None:
    """Errors of unseen rows, without noise and with, at most three cautions, `more` of them last; verbose: also
    training rows, shares that intervals hold, what errors come from and the range of the training. over_first: output
    -> RMSE over that of the first of several sets."""
    if verbose:
        _print_all(result)
    else:
        _print_unseen(result, over_first or {})
    shown, rest = foremost([*_cautions(result), *more], verbose)
    for words in shown:
        print(f"caution: {words}")
    if not verbose:
        print("with --verbose: " + ", ".join(filter(None, (rest, "training rows", "shares that intervals hold",
                                                           "the trained range"))))


def print_verdict(scores: Mapping[str, Any], *, verbose: bool = False) -> None:
    """Whether the 90 % intervals of labelled presses hold, and by what; verbose: also the diagnostics."""
    from rich import box
    from rich.table import Table

    verdict = scores["verdict"]
    if verdict is None:
        print(f"verdict: nothing is vouched for: {_unjudged(scores)}")
        return
    if verbose:
        levels = ", ".join(f"{100 * level:.0f}" for level in verdict["levels"])
        table = Table("output", "in 90 %", "+-90 %", "chance of so few", f"held of {levels} %", "ranks, %",
                      box=box.SIMPLE_HEAD, show_edge=False)
        for name, one in verdict["outputs"].items():
            table.add_row(name, f"{100 * one['coverage_90']:.0f} %", f"{one['half_width_90']:.3g}",
                          f"{one['chance']:.2g}", *(", ".join(f"{100 * part:.0f}" for part in one[key])
                                                    for key in ("expected_coverage", "ranks")))
        print_table(table)
        if "random_points" in verdict:
            held = ", ".join(f"{100 * part:.0f}" for part in verdict["random_points"])
            print(f"regions about random points of {levels} % hold {held} % (TARP)")
    failed = [name for name, one in verdict["outputs"].items() if not one["holds"]]
    of = f"{verdict['presses']} presses" + f" of {verdict['frames']} frames" * (verdict["frames"] > verdict["presses"])
    said = "intervals hold" if not failed else f"intervals of {', '.join(failed)} do not hold"
    held = ", ".join(f"{name} {100 * one['coverage_90']:.0f} %" for name, one in verdict["outputs"].items())
    far = f"distance {verdict['distance_mm']:.3g} mm; " if "distance_mm" in verdict else ""
    print(f"verdict: {said}: {far}the 90 % intervals hold {held} of {of} without a flag; "
          f"{100 * verdict['flagged']:.0f} % of the frames are flagged")


def _unjudged(scores: Mapping[str, Any]) -> str:
    """Why there is no verdict, and what the intervals of flagged frames hold."""
    unseen = {name: parts[one] for name, parts in scores["outputs"].items() for one in ("new", "all") if one in parts}
    if not unseen:
        return "all labelled presses were trained on. Give labels of presses that were kept back."
    held = ", ".join(f"{name} {100 * one['coverage_90']:.0f} %" for name, one in unseen.items())
    return f"every frame that was not trained on is flagged ({scores['scored']}); their 90 % intervals hold {held}"


def print_next(model: SweepModel, out: Path) -> None:
    """Where the model is, and what may be done with it."""
    print(f"""model: {out}
next:
  surrogate predict {out} frames.csv --out touches.csv
  surrogate report {out} --out {out.name}.pdf""")


def collapses(model: SweepModel) -> Iterator[str]:
    """Networks that say little more than the mean."""
    for name, record in model.record["training"].items():
        if isinstance(record, dict) and record.get("collapsed"):
            yield f"{name}: the evidence collapsed in every start; this network says little more than the mean."


def _print_unseen(result: Mapping[str, Any], over_first: Mapping[str, float | None]) -> None:
    """One row an output: its error without noise and at each level, and how many of its 90 % intervals hold."""
    from rich import box
    from rich.table import Table

    from surrogate.model.evaluate import UNSEEN

    levels = result["noise"]
    table = Table("output", "unit", "RMSE", *(f"{one['db_below_baseline']:.4g} dB" for one in levels), "R2", "+-90 %",
                  "in 90 %", "n", *(["over first"] if over_first else []), box=box.SIMPLE_HEAD, show_edge=False)
    for name, parts in result["outputs"].items():
        part = next((one for one in UNSEEN if one in parts), "train")
        s = parts[part]
        noisy = [level["outputs"].get(name, {}).get(part) for level in levels]
        table.add_row(name, s["unit"], f"{s['rmse']:.3g}", *("-" if one is None else f"{one['rmse']:.3g}"
                                                             for one in noisy),
                      "constant" if s["r2"] is None else f"{s['r2']:.4f}", f"{s['half_width_90']:.3g}",
                      "-" if s["coverage_90"] is None else f"{100 * s['coverage_90']:.0f} %", str(s["n"]),
                      *(["-" if (over := over_first.get(name)) is None else f"{over:.3g}"] if over_first else []))
    print_table(table)
    if levels:
        print("dB: noise so far below the r.m.s. of the untouched readings.")
    print("in 90 %: rows that the 90 % intervals hold; +-90 %: their median half width.")
    print(f"{result['method']}: fit {result['fit_s']:.1f} CPU s, predict {result['predict_ms']:.2f} CPU ms a frame")


def _print_all(result: Mapping[str, Any]) -> None:
    _print_table(f"{result['method']}, no noise added", result["outputs"], ("train", "test", "new", "all"), {})
    for level in result["noise"]:
        title = (f"{result['method']}, noise {level['db_below_baseline']:.1f} dB below the baseline,\n"
                 f"{level['db_below_signal']:.1f} dB below the signal")
        _print_table(title, level["outputs"], ("test", "new", "all"), level.get("limits", {}))
    print(f"fit {result['fit_s']:.1f} CPU s, predict {result['predict_ms']:.2f} CPU ms a frame")
    if result["scored"]:
        print(f"scored: {result['scored']}")
    if "intervals" in result:
        _print_of_sweep(result)


def _cautions(result: Mapping[str, Any]) -> Iterator[str]:
    """The gravest first: on intervals of another measurement, on outputs that are read no better than by their mean, on
    intervals that hold too little, and on few rows."""
    from surrogate.statistics.coverage_check import CoverageCheck, in_words

    if result.get("interval_caution"):
        yield result["interval_caution"]
    worst = {name: min((s["r2"] for part, s in parts.items() if part != "train" and s["r2"] is not None), default=1.0)
             for name, parts in result["outputs"].items()}
    if useless := [f"{name} (R2 {r2:.3g})" for name, r2 in worst.items() if r2 <= 0]:
        yield f"read no better than by the mean, not to be used: {', '.join(useless)}."
    if "intervals" in result:
        yield from _off_nominal(result)
        if result["few_interval_rows"]:
            yield result["few_interval_rows"]
    else:
        for one in result.get("coverage_below", ()):
            check = CoverageCheck(**{field: one[field] for field in CoverageCheck.__dataclass_fields__})
            yield in_words(check, one["output"])


def _off_nominal(result: Mapping[str, Any]) -> Iterator[str]:
    """Of unseen rows whose intervals hold a smaller part than they state, by output and noise, in words."""
    from surrogate.statistics.coverage_check import coverage_check, in_words

    tables = [("without added noise", result["outputs"])]
    tables += [(f"at {level['db_below_baseline']:.1f} dB", level["outputs"]) for level in result["noise"]]
    scored = [(f"{name}, {part} rows, {where}", one) for where, outputs in tables for name, parts in outputs.items()
              for part, one in parts.items() if part != "train"]
    for name, one in scored:
        if (check := coverage_check(one["coverage_90"], one["n"], checks=len(scored))).too_low:
            yield in_words(check, name)


def _print_of_sweep(result: Mapping[str, Any]) -> None:
    """What is known of a data set and its model, and not of a recording."""
    print(f"baseline RMS {result['baseline_rms_V']:.4g} V, signal RMS {result['signal_rms_V']:.4g} V")
    if result["force_sd"]:
        parts = ", ".join(f"{part} {value:.3g}" for part, value in result["force_sd"].items())
        print(f"standard deviation of the force, N, RMS before calibration, squares add up: {parts}")
    if result["material"]:
        print(f"material: {result['material']}")
    print(f"intervals: {result['intervals']}")
    if result["amplitude"]:
        _print_amplitude(result["amplitude"])
    units = {name: next(iter(parts.values()))["unit"] for name, parts in result["outputs"].items()}
    spans = ", ".join(f"{name} {low:.4g} to {high:.4g} {units[name]}"
                      for name, (low, high) in result["trained_range"].items())
    print(f"trained range, within which intervals hold: {spans}")


def _print_table(title: str, scored: Mapping[str, Any], shown: tuple[str, ...],
                 limits: Mapping[str, Mapping[str, float]]) -> None:
    """limits: material -> output -> least possible error, as `bound_files.at_level`."""
    from rich.console import Console
    from rich.table import Table

    from surrogate.bounds.bound_files import MATERIALS

    table = Table("output", "rows", "RMSE", "R2", "in 50/90/95 %", "+-90 %", "n",
                  *(MATERIALS[name] for name in limits), title=title)
    for name, parts in scored.items():
        for part in (p for p in shown if p in parts):
            s = parts[part]
            r2 = "constant" if s["r2"] is None else f"{s['r2']:.4f}"
            least = [f"{of[name]:.4g}" if name in of else "-" for of in limits.values()]
            table.add_row(name, part, f"{s['rmse']:.4g} {s['unit']}", r2, _held(s),
                          f"{s['half_width_90']:.4g}", str(s["n"]), *least)
    Console().print(table)


def _print_amplitude(amplitude: Mapping[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("d, mm", "RMS at its top, mV", "at F, N", "RMS at most F, mV", "F of two answers, N",
                  title=f"signal over force, {amplitude['radius_mm']:.3g} mm from {amplitude['centre']}")
    for one in amplitude["diameters"]:
        ends, force = one["two_answers_N"], amplitude["force_N"]
        peak = force[-1] if one["peak_N"] is None else one["peak_N"]
        table.add_row(f"{one['d_mm']:.4g}", f"{1e3 * one['rms_V'][force.index(peak)]:.3g}",
                      "highest" if one["peak_N"] is None else f"{peak:.2f}", f"{1e3 * one['rms_V'][-1]:.3g}",
                      "-" if ends is None else f"{ends[0]:.2f} to {ends[1]:.2f}")
    Console().print(table)


def print_transfer(table: Mapping[str, list[dict[str, Any]]]) -> None:
    from rich.console import Console
    from rich.table import Table

    shown = Table("output", "set", "rows", "RMSE", "over first", "in 50/90/95 %", "+-90 %", "n",
                  title="transfer, no noise added, unseen rows")
    for name, rows in table.items():
        for s in rows:
            over = "-" if s["rmse_over_first"] is None else f"{s['rmse_over_first']:.3g}"
            shown.add_row(name, s["set"], s["part"], f"{s['rmse']:.4g} {s['unit']}", over, _held(s),
                          f"{s['half_width_90']:.4g}", str(s["n"]))
    Console().print(shown)


def _held(score: Mapping[str, Any]) -> str:
    held = [score[f"coverage_{level}"] for level in (50, 90, 95)]
    return "/".join("-" if one is None else f"{100 * one:.0f}" for one in held)
