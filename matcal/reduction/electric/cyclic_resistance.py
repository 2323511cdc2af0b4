"""How the resistance of a coated strip settles over the cycles of a stretch (paper, figure 6b)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import chdtrc

from touchcal.arrays import Array

_TURN = 0.10  # share of the largest strain, at either turning point, over which the resistance is read
_FEWEST = 5  # fewest turning points for a course of three parameters
_DOUBTFUL = 0.01  # probability of a larger misfit below which the course is no single exponential


@dataclass(frozen=True)
class ResistanceHistory:
    """R(k) = R_inf + (R_0 - R_inf) exp(-k/k_c) over k cycles."""

    first_Ohm: float  # resistance at first, Ohm
    settled_Ohm: float  # resistance in the end, Ohm
    cycles: float  # cycles after which 1/e of the change is left
    sd: tuple[float, float, float]  # standard errors of the three, same units
    likely: float  # probability of a larger misfit under the noise of the readings

    def at(self, cycle: Array) -> Array:
        """R, Ohm, after `cycle` cycles (n,)."""
        return self.settled_Ohm + (self.first_Ohm - self.settled_Ohm) * np.exp(-cycle / self.cycles)


@dataclass(frozen=True)
class Turns:
    """Resistance at the turning points of one side."""

    cycle: Array  # (m,) cycles behind each
    resistance_Ohm: Array  # (m,) resistance at the turning strain, Ohm
    sd_Ohm: Array  # (m,) its standard error, Ohm


def turning_points(strain: Array, resistance: Array) -> tuple[Turns, Turns]:
    """Resistance at rest, before the first cycle and after each, and at the peaks, from samples (n,) of both in order.
    Near each turning point R is a straight line in the strain, read where the strain turns. ValueError where there is
    no cycle."""
    largest = float(strain.max())
    low, high = _groups(strain < _TURN * largest), _groups(strain > (1 - _TURN) * largest)
    if len(low) < 2 or not high:
        raise ValueError("no whole cycle lies in the electrical record")
    rest = [_read(strain[g], resistance[g], 0.0) for g in low]
    peak = [_read(strain[g], resistance[g], largest) for g in high]
    return _turns(0.0, rest), _turns(0.5, peak)


def _groups(inside: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    found = np.flatnonzero(inside)
    groups = np.split(found, np.flatnonzero(np.diff(found) > 1) + 1)
    return [g for g in groups if g.size >= 3]


def _read(strain: Array, resistance: Array, at: float) -> tuple[float, float]:
    """Value of the straight line through the samples at one strain, and its standard error."""
    span = float(np.ptp(strain))
    basis = np.column_stack([np.ones(strain.size), (strain - at) / span if span > 0 else np.zeros(strain.size)])
    factors, *_ = np.linalg.lstsq(basis, resistance, rcond=None)
    scatter = np.sum((resistance - basis @ factors) ** 2) / max(strain.size - 2, 1)
    return float(factors[0]), float(np.sqrt(scatter * np.linalg.pinv(basis.T @ basis)[0, 0]))


def _turns(first: float, found: list[tuple[float, float]]) -> Turns:
    value, sd = np.array(found, dtype=float).T
    return Turns(np.arange(value.size, dtype=float) + first, value, np.maximum(sd, 1e-6 * np.abs(value)))


def fit_history(turns: Turns) -> ResistanceHistory | None:
    """Weighted least squares of the exponential course; None for fewer than 5 turning points."""
    if turns.cycle.size < _FEWEST:
        return None
    span, unit = float(np.ptp(turns.cycle)), float(turns.resistance_Ohm[-1])

    def miss(p: Array) -> Array:
        model = unit * (p[1] + (p[0] - p[1]) * np.exp(-turns.cycle / np.exp(p[2])))
        return (model - turns.resistance_Ohm) / turns.sd_Ohm

    start = turns.resistance_Ohm[[0, -1]] / unit
    bounds = ([-np.inf, -np.inf, np.log(0.05)], [np.inf, np.inf, np.log(100 * span)])
    tried = [least_squares(miss, [*start, np.log(k)], bounds=bounds, x_scale=[0.1, 0.1, 0.5])
             for k in (0.1 * span, 0.3 * span, span)]
    best = min(tried, key=lambda out: out.cost)
    freedom = turns.cycle.size - 3
    widen = max(1.0, 2 * best.cost / freedom)
    sd = np.sqrt(widen * np.diag(np.linalg.pinv(best.jac.T @ best.jac)))
    constant = float(np.exp(best.x[2]))
    return ResistanceHistory(float(unit * best.x[0]), float(unit * best.x[1]), constant,
                             (float(unit * sd[0]), float(unit * sd[1]), float(constant * sd[2])),
                             float(chdtrc(freedom, 2 * best.cost)))


def cycle_table(rest: Turns, peak: Turns) -> dict[str, Array]:
    """One row a cycle, counted from 1: resistance, Ohm, at the rest it starts from and at its peak, and the courses."""
    rows = min(rest.cycle.size - 1, peak.cycle.size)
    out = {"cycle": np.arange(1.0, rows + 1)}
    for name, turns in (("rest", rest), ("peak", peak)):
        out[f"resistance_{name}_Ohm"] = turns.resistance_Ohm[:rows]
        if (history := fit_history(turns)) is not None:
            out[f"fit_resistance_{name}_Ohm"] = history.at(turns.cycle[:rows])
    return out


def settling_facts(rest: Turns, peak: Turns, doubt: float = 0.0) -> dict[str, float]:
    """First, last and settled resistance at rest, the change by the last cycle, and the course's numbers. `doubt` is
    the standard deviation of where a strip rests between cycles, over the largest travel."""
    value = rest.resistance_Ohm
    out = {"resistance_first_Ohm": float(value[0]), "resistance_settled_Ohm": float(value[-1]),
           "cycles": float(value.size - 1), "resistance_last_change": float(value[-1] / value[-2] - 1)}
    swing = float(peak.resistance_Ohm[-1] - value[-1])
    if (history := fit_history(rest)) is not None:
        out |= {"settling_first_Ohm": history.first_Ohm, "settling_first_sd_Ohm": history.sd[0],
                "settling_final_Ohm": history.settled_Ohm,
                "settling_final_sd_Ohm": float(np.hypot(history.sd[1], doubt * swing)),
                "settling_cycles": history.cycles, "settling_cycles_sd": history.sd[2],
                "settling_likely": history.likely}
    return out


def settling_sentences(facts: Mapping[str, float]) -> list[str]:
    """What the cycles did to the resistance, in words."""
    out = [f"Cyclic stage: resistance at rest goes from {facts['resistance_first_Ohm']:.1f} to "
           f"{facts['resistance_settled_Ohm']:.1f} Ohm in {facts['cycles']:.0f} cycles, the last changing it by "
           f"{facts['resistance_last_change']:.2%}; c is read from the last cycle."]
    if "settling_cycles" not in facts:
        return [*out, "Too few cycles to fit how it settles."]
    if facts["settling_cycles"] > 3 * facts["cycles"]:
        return [*out, "It has not settled: its course is still straight after all cycles, so no final value is given."]
    left = facts["resistance_settled_Ohm"] / facts["settling_final_Ohm"] - 1
    out.append(f"It settles as exp(-cycles/{facts['settling_cycles']:.2f} ± {facts['settling_cycles_sd']:.2f}) from "
               f"{facts['settling_first_Ohm']:.1f} ± {facts['settling_first_sd_Ohm']:.1f} to "
               f"{facts['settling_final_Ohm']:.1f} ± {facts['settling_final_sd_Ohm']:.1f} Ohm; {left:.2%} is left "
               "after the last cycle.")
    if facts["settling_likely"] < _DOUBTFUL:
        out.append("Its course is no single exponential within the noise of the readings (probability "
                   f"{facts['settling_likely']:.1g}); the errors above are widened by the misfit.")
    return out
