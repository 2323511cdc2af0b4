"""Stored benchmarks as points of error against run time: which column of which file tells what."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.report.stored_tables import read_rows
from touchcal.errors import InputFileError

Words = Callable[[Mapping[str, Any]], str]


@dataclass(frozen=True)
class Point:
    """What one method, at one setting, reached of one problem."""

    problem: str
    method: str
    setting: str
    line: str  # points of one line are joined
    measure: float  # the error, or the size
    cost_s: float  # CPU time, s
    once_s: float  # of what was done once and is not counted in it, s


@dataclass(frozen=True)
class Bench:
    """One file of benchmarks/results and how it is drawn."""

    name: str  # of the plate
    file: str  # in the folder of results; the benchmark that writes it has the same stem
    title: str  # what is solved
    problem: Words  # row -> what shares a panel
    method: Words  # row -> the method
    setting: Words  # row -> its setting
    line: Words  # row -> what tells which points of a method are joined, next to the method
    measure: str  # column of the error, or of the size where every method solves one system
    label: str  # what its axis says
    cost: str = "cpu_s"  # column of the CPU time
    per_second: float = 1.0  # how many of its units are a second
    once: str = ""  # column, in the same unit, of what is done once and not counted in the cost; "" for none
    is_error: bool = True  # whether the measure is an error, so that less is better
    note: str = ""  # what the reader must know of the comparison, one sentence or none
    # errors that are asked for, in the table of the cheapest; a finding speaks of the second
    requested: tuple[float, ...] = (1e-2, 1e-3, 1e-4)
    # row -> the measure where no column holds it, and whether the row is drawn
    value: Callable[[Mapping[str, Any]], float] | None = None
    drawn: Callable[[Mapping[str, Any]], bool] = lambda _: True
    writer: str = ""  # the benchmark that writes the file, where its stem is not the file's
    use: str = ""  # what its line of the verdict is about; "" for none

    @property
    def benchmark(self) -> str:
        """Stem of the benchmark that writes the file."""
        return self.writer or self.file.removesuffix(".csv")

    def of(self, row: Mapping[str, Any]) -> float:
        """The measure of a row; KeyError where a column is missing."""
        return row[self.measure] if self.value is None else self.value(row)


def _with_kind(row: Mapping[str, Any]) -> str:
    """Method and the first words of its setting: its order or element."""
    return f"{row['method'].replace('ours', 'eitsim')}, {row['setting'].partition(',')[0]}"


def _element(row: Mapping[str, Any]) -> str:
    return f"{row['element_um']:g} µm"


def _element_and_rest(row: Mapping[str, Any]) -> str:
    """Size of element and the words of the setting that `_with_kind` leaves out."""
    return "".join([_element(row), *row["setting"].partition(",")[1:]])


def _one(_: Mapping[str, Any]) -> str:
    return ""


def _electrics(row: Mapping[str, Any]) -> str:
    """The method, in words that need no explanation."""
    return row["method"].replace(" that follows", ", mesh follows the touch").replace("rings that scatter",
                                                                                      "scattering by rings")


def _start(row: Mapping[str, Any]) -> str:
    """Method of a fit, with the place that a single start begins from."""
    *start, _ = row["setting"].split(", ")
    return ", ".join([row["method"], *start]) if start and start[0].split()[0] == "from" else row["method"]


def _place(row: Mapping[str, Any]) -> str:
    return row["scene"].replace(", d = 14 mm", "")


def _asked(row: Mapping[str, Any]) -> str:
    return f"asked for {row['wanted']:.2g} of the signal"


def _steps(row: Mapping[str, Any]) -> str:
    return "" if math.isnan(row["steps"]) else f"{row['steps']:.0f} steps"


def _draws(row: Mapping[str, Any]) -> str:
    return f"{row['ess_worst']:.0f} effective draws, R-hat {row['rhat_worst']:.2f}"


def _over_spread(row: Mapping[str, Any]) -> float:
    """RMSE over the spread of the output over the scored rows."""
    return math.sqrt(max(1 - row["r2"], 0.0))


BENCHES = (
    Bench("fit", "calibration.csv", "fit of three terms to two curves", lambda _: "synthetic compression and shear",
          _start, lambda row: row["setting"], lambda row: row["setting"].partition(",")[0], "distance_from_best",
          "Distance from the best fit (–)", note="What noise in the data leaves of the truth, 0.4 % in μ₀, stands "
          "next to it. From some starts lmfit ends in another minimum, at any tolerance; Table 1 is a fit of such a "
          "foam, and thus a start that a new foam lacks.", use="Fit of a foam law"),
    Bench("sampler", "sampler.csv", "posterior of that fit", lambda _: "exponents, moduli and noise",
          lambda row: row["method"], _draws, _one, "mean_error_over_sd", "Error of a mean over sd (–)",
          requested=(1e-1, 3e-2, 1e-2), note="Monte Carlo error of the worst quantity over its posterior's sd, from "
          "effective draws. Where R-hat, which the table tells, is not close to 1, chains have not mixed: their "
          "effective draws are too many and their errors too small.", use="Posterior of a foam law"),
    Bench("electrics", "electrics.csv", "208 readings of one touch", lambda row: row["touch"],
          _electrics, lambda row: row["setting"], _one, "dv_error", "Relative error of ΔV (–)",
          "cpu_ms", 1e3, "kept_ms", note="P1 and P2 are linear and quadratic triangles, Q2 quadrilaterals. Set-up is "
          "not drawn: the order of a fixed mesh and its untouched skin; where the system is condensed to the touched "
          "part, its mesh and all outside it, which is taken as untouched.", use="Readings of a touch"),
    Bench("peers_electrics", "peers_electrics.csv", "impedance of 16 electrodes for a new conductance",
          lambda _: "the same mesh and elements", lambda row: row["method"].replace(", ", " with "),
          lambda row: f"{row['triangles']} triangles", _one, "unknowns", "Unknowns (–)", is_error=False,
          note="All solve the same linear triangles, so that their discretisation error is the same; pyEIT's point "
          "electrodes are another model.", use="Speed next to other programs"),
    Bench("peers_signal", "peers_signal.csv", "208 readings of one touch by peers", lambda row: row["touch"],
          lambda row: row["method"].replace("pyEIT, ", "pyEIT with "), lambda row: row["setting"], _one, "dv_error",
          "Relative error of ΔV (–)", note="A smooth fall of an isotropic conductance, which all take. eitsim and "
          "EIDORS solve the same linear triangles, and thus have one error; pyEIT's point electrodes are another "
          "model, whose error is in its own. What follows the touch makes its mesh anew, the others keep theirs."),
    Bench("mechanics", "mechanics.csv", "depth of one touch by size of element", lambda row: row["touch"],
          lambda _: "eitsim", _element, _one, "depth_error", "Relative error of the depth (–)", use="Depth of a touch"),
    Bench("peers_mechanics", "peers_mechanics.csv", "depth of one touch by peers", lambda row: row["touch"],
          _with_kind, _element_and_rest, lambda row: row["setting"], "depth_error", "Relative error of the depth (–)"),
    Bench("scenes", "scenes.csv", "whole scenes of a 14 mm punch, from the plan to 208 readings", _place,
          lambda row: row["method"], _asked, _one, "dv_error", "Relative error of ΔV (–)",
          note="Against finer solutions, whose own error estimate is in the file (reference_error). No other program "
          "of the comparison solves touch and readings together: its peers stand in the diagrams of the mechanics and "
          "of the readings.", use="Whole scenes"),
    Bench("sweep", "sweeps_ways.csv", "rows of the paper's sweep", lambda row: row["place"],
          lambda row: row["way"], lambda row: f"{row['rows']} rows", _one, "dv_error",
          "Median error of ΔV (–)", once="tables_cpu_s_per_row", writer="sweeps", note="Against the same "
          "scenes with nothing left out; the set-up are the tables, shared by all rows of the set.",
          use="Rows of a sweep"),
    Bench("surrogates", "surrogates_time.csv", "what surrogates read of unseen touches, by training",
          lambda row: f"{row['output']}", lambda row: row["method"], _steps, _one, "rmse_over_spread",
          "RMSE over spread (–)", cost="fit_cpu_s", value=_over_spread, requested=(3e-1, 1e-1, 3e-2),
          drawn=lambda row: row["output"] in ("x0", "y0", "d", "F"), writer="surrogates",
          note="Noise-free rows of the paper's sweep, and the training's CPU time; trainbr and network are the paper's "
          "kind.", use="Learned place, size and force"),
)


def points(bench: Bench, folder: Path) -> tuple[list[Point], int]:
    """Points of a benchmark, and how many rows its file has; rows whose measure or cost is no positive number hold no
    point. FileNotFoundError where the file is not there, InputFileError where it lacks a column."""
    path = folder / bench.file
    try:
        rows = [row for row in read_rows(path) if bench.drawn(row)]
        found = [_point(bench, row) for row in rows if _positive(bench.of(row)) and _positive(row[bench.cost])]
    except KeyError as missing:
        raise InputFileError(path, f"column {missing} is not there; run benchmarks/{bench.benchmark}.py again."
                             ) from None
    return found, len(rows)


def _positive(value: float) -> bool:
    return 0 < value < math.inf


def _point(bench: Bench, row: Mapping[str, Any]) -> Point:
    once = row[bench.once] if bench.once else 0.0
    return Point(bench.problem(row), bench.method(row), bench.setting(row), bench.line(row), bench.of(row),
                 row[bench.cost] / bench.per_second, once / bench.per_second)


def by_problem(found: Sequence[Point]) -> dict[str, list[Point]]:
    """Points of each problem, in the order of the file."""
    return {problem: [p for p in found if p.problem == problem] for problem in dict.fromkeys(p.problem for p in found)}


def cheapest(found: Sequence[Point], requested: float, *, again: bool = False) -> Point | None:
    """The point of least cost whose error is at most the requested one, what is done once included but where it is done
    `again`; None where there is none."""
    good = (p for p in found if p.measure <= requested)
    return min(good, key=lambda p: p.cost_s + (0.0 if again else p.once_s), default=None)
