"""The whole calibration: Prony series and hyperfoam law by turns, contact points refined, conductivity beside them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from matcal.conductivity_fit import ConductivityFit, fit_conductivity
from matcal.curves import Curve, weigh, with_history
from matcal.experiment import Experiment
from matcal.fit import Fit, fit, quick_law
from matcal.hyperfoam import Hyperfoam
from matcal.modes import MODES
from matcal.nuisance import refined_records, with_drift
from matcal.prony import Prony
from matcal.relaxation_fit import PronyFit, fit_prony
from matcal.stability import margin, unstable_ranges
from matcal.uncertainty import Uncertainty, linearised

# turns of (series, law) at most, and the change of g below which they have settled
_TURNS, _SETTLED = 6, 1e-5


@dataclass(frozen=True)
class Choices:
    """What the user may choose about a calibration."""

    # terms of the law: 1 to 4, or "auto"
    order: int | str = "auto"
    # one Poisson-like ratio for all terms, or "fit"
    poisson: float | str = 0.0
    # criterion that the law must satisfy over the fitted strains, or None
    stable: str | None = None
    # how residuals are measured, one of matcal.curves.RESIDUALS
    residual: str = "relative"
    # kind -> weight
    weights: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Calibration:
    """Everything that one calibration found."""

    # reduced tests, in the order given
    experiments: tuple[Experiment, ...]
    # long-term law; None without a stress-strain curve
    fit: Fit | None
    # its linearised intervals
    uncertainty: Uncertainty | None
    # relaxation; None without a relaxation test
    prony: PronyFit | None
    # skin; None without a conductivity test
    conductivity: ConductivityFit | None
    # stage -> what was decided there, one sentence each, in order
    stages: Mapping[str, tuple[str, ...]]
    # stage -> CPU seconds
    cpu_s: Mapping[str, float]

    @property
    def decisions(self) -> tuple[str, ...]:
        """The sentences of all stages."""
        return tuple(sentence for said in self.stages.values() for sentence in said)


def calibrate(experiments: Sequence[Experiment], choices: Choices | None = None) -> Calibration:
    """Fit everything that the experiments allow.

    Raises ValueError for an unknown choice or for tests that cannot be fitted.
    """
    choices = choices or Choices()
    started = time.process_time()
    experiments, said = with_drift(experiments)
    relaxing = [e for e in experiments if e.kind == "relaxation"]
    curves = weigh(experiments, choices.residual, choices.weights)
    prony = _prony(relaxing, curves, choices) if relaxing else None
    series_s = time.process_time() - started
    law, uncertainty, how = None, None, ()
    if curves:
        law, how = _law(curves, prony, choices)
        uncertainty = linearised(law, prony)
    law_s = time.process_time() - started - series_s
    stretched = [e for e in experiments if e.kind == "conductivity"]
    skin = fit_conductivity(stretched) if stretched else None
    total = time.process_time() - started
    checks = (*_stiffness_sentences(prony), *_drucker_sentences(law)) if law else ()
    stages = {"records": said, "relaxation": prony.decisions if prony else (), "law": how, "checks": checks,
              "skin": skin.decisions if skin else ()}
    return Calibration(tuple(experiments), law, uncertainty, prony, skin, stages,
                       {"prony": series_s, "hyperfoam": law_s, "conductivity": total - series_s - law_s, "all": total})


def _prony(relaxing: Sequence[Experiment], curves: Sequence[Curve], choices: Choices) -> PronyFit:
    """Series through the shape of the law, which is fitted again with each series until they agree."""
    if not curves:
        return fit_prony(relaxing, None)
    nu = 0.0 if choices.poisson == "fit" else float(choices.poisson)
    law: Hyperfoam = quick_law(curves, choices.order, nu)
    found = fit_prony(relaxing, law)
    for turn in range(2, _TURNS + 1):
        law = quick_law([with_history(c, found.prony) for c in curves], choices.order, nu)
        before, found = found.prony, fit_prony(relaxing, law)
        if np.abs(found.prony.g - before.g).max() < _SETTLED:
            return replace(found, decisions=(*found.decisions, *_turn_sentences(turn, relaxing, law)))
    return replace(found, decisions=(*found.decisions, f"Series and law still changed after {_TURNS} turns by "
                                     f"{np.abs(found.prony.g - before.g).max():.1g} in g."))


def _turn_sentences(turns: int, relaxing: Sequence[Experiment], law: Hyperfoam) -> list[str]:
    out = [f"Series and law were fitted by turns until they agreed, {turns} turns."]
    deepest = min(float(e.strain.min()) for e in relaxing)
    if deepest < law.strain_range.get("uniaxial", (0.0, 0.0))[0] - 0.02:
        out.append(f"The relaxation test reaches a strain of {deepest:.2f}, beyond the compression curve in hand: the "
                   "shape of its ramp is an extrapolation.")
    return out


def _law(curves: tuple[Curve, ...], prony: PronyFit | None, choices: Choices) -> tuple[Fit, tuple[str, ...]]:
    curves = tuple(with_history(c, prony.prony) for c in curves) if prony else curves
    first = fit(curves, choices.order, choices.poisson, starts=3, thorough=False)
    curves, moved = refined_records(first)
    found = fit(curves, choices.order, choices.poisson, stable=choices.stable)
    return found, (_moduli_sentence(curves, prony.prony if prony else None), *moved, *found.decisions)


def _moduli_sentence(curves: Sequence[Curve], prony: Prony | None) -> str:
    if prony is None:
        return ("Moduli are labelled long-term: no relaxation file was given, so the stress that has not relaxed yet "
                "at the rate of these tests is not corrected for and counts as long-term.")
    without = [c.label for c in curves if c.kernel is None]
    said = (f"Moduli are long-term, corrected for rate: each test's own history is convolved with the Prony series on "
            f"its second Piola-Kirchhoff stress, then mu_longterm = {prony.g_infinity:.4f} mu_instantaneous.")
    return said + (f" No time column, taken as long-term: {', '.join(without)}." if without else "")


def _stiffness_sentences(prony: PronyFit | None) -> list[str]:
    if prony is None:
        return []
    ratios = ", ".join(f"{a * prony.prony.g_infinity:.3f}" for a in prony.amplitude)
    return [f"Held stress over what the law gives there: {ratios}; only the shape of the hold was fitted, so this "
            "compares one specimen with another."]


def _drucker_sentences(found: Fit) -> list[str]:
    """Where the law loses Drucker stability in the compression that was tested, and whether the record itself does."""
    lowest = found.law.strain_range.get("uniaxial", (0.0, 0.0))[0]
    if lowest > -0.02:
        return []
    ranges = unstable_ranges(lambda e: margin(found.law, "drucker", "uniaxial", e), np.linspace(lowest, 0.0, 161))
    if not ranges:
        return []
    said = [f"The law is not Drucker stable in compression for strains {lo:.3f} to {hi:.3f}." for lo, hi in ranges]
    e, stress = _compression(found)
    falls = [abs((1 + hi) * np.interp(hi, e, stress)) > abs((1 + lo) * np.interp(lo, e, stress)) for lo, hi in ranges]
    if any(falls) and not np.any(found.law.nu):
        said.append("In the record itself |lambda P| falls there, so no law with nu = 0 that follows it can be "
                    "Drucker stable; --stable drucker shows what stability costs.")
    return said


def _compression(found: Fit) -> tuple[np.ndarray, np.ndarray]:
    curve = min((c.experiment for c in found.curves if c.experiment.kind == "uniaxial"), key=lambda x: x.strain.min())
    order = np.argsort(curve.strain)
    return curve.strain[order], curve.value[order]


def labels(experiments: Sequence[Experiment]) -> list[str]:
    """KIND_i of each experiment, in order; the same names as the curves of a fit."""
    seen: dict[str, int] = {}
    out = []
    for experiment in experiments:
        seen[experiment.kind] = seen.get(experiment.kind, 0) + 1
        out.append(f"{experiment.kind}_{seen[experiment.kind]}")
    return out


def is_curve(experiment: Experiment) -> bool:
    """Whether an experiment is a stress-strain curve."""
    return experiment.kind in MODES
