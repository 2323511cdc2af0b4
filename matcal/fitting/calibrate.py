"""The whole calibration: Prony series and hyperfoam law by turns, contact points refined, conductivity separately."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from matcal.fitting.conductivity_fit import ConductivityFit, fit_conductivity
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.fitters import Fitter, fitter_of
from matcal.fitting.hyperfoam.cross_prediction import Predicted, predictions, unstable_within
from matcal.fitting.hyperfoam.curves import Curve, weigh, with_history
from matcal.fitting.hyperfoam.hyperfoam_fit import NEARLY, Fit
from matcal.fitting.hyperfoam.next_specimen import NextSpecimen, next_specimens
from matcal.fitting.hyperfoam.record_stability import DataCheck, check_data, check_sentences
from matcal.fitting.hyperfoam.specimen_factors import factor_sentences, replicated, with_factors
from matcal.fitting.law_choice import LawChoice, chosen_law
from matcal.fitting.relaxation.joint_series import JointSeries, joined, joint_series, together
from matcal.fitting.relaxation.record_thinning import thinned
from matcal.fitting.relaxation.relaxation_fit import ALONE, PronyFit, Together, fit_prony, order_sentences
from matcal.fitting.relaxation.series import Series
from matcal.fitting.relaxation.spectrum_fit import SpectrumFit, fit_spectrum
from matcal.fitting.softening_fit import SofteningFit, fit_softening
from matcal.fitting.uncertainty.intervals import Uncertainty, linearised
from matcal.fitting.uncertainty.nuisance import (
    moved_sentences,
    refined_records,
    surprise,
    uncertain,
    with_drift,
    with_zero,
    without_load_zero,
)
from matcal.fitting.uncertainty.two_nu import TwoNu, two_nu
from matcal.laws.deformation_modes import MODES
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from matcal.reduction.experiment import CROSSED_S, Experiment
from touchcal.number_words import percent

_TURNS, _SETTLED = 6, 1e-5  # turns of (series, law) at most, and the change of g below which they have settled
_FACTOR_TURNS = 2  # fits that find the factors of specimens
_RECORD_TURNS, _NEARLY_STILL = 3, 0.05  # refinements of the records at most; moves of zeros, in their deviations
CRITERION_NAMES = {"drucker": "Drucker stable", "elliptic": "strongly elliptic"}


@dataclass(frozen=True)
class FittedLaws:
    """Every law that one calibration fitted, and how."""

    experiments: tuple[Experiment, ...]  # reduced tests, in the order given
    fit: Fit | None  # long-term law; None without a stress-strain curve
    uncertainty: Uncertainty | None  # its linearised intervals
    prony: PronyFit | None  # relaxation; None without a relaxation test
    conductivity: ConductivityFit | None  # skin; None without a conductivity test
    stages: Mapping[str, tuple[str, ...]]  # stage -> what was decided there, one sentence each, in order
    cpu_s: Mapping[str, float]  # stage -> CPU seconds
    predicted: tuple[Predicted, ...] = ()  # tests kept out of the fit, and the errors with which its laws predict them
    data_checks: tuple[DataCheck, ...] = ()  # what the records themselves say about stability
    two_nu: TwoNu | None = None  # nu by lateral strains and by all else, where there are both
    softening: SofteningFit | None = None  # by earlier loading; None where no test has a whole path
    spectrum: SpectrumFit | None = None  # relaxation of a dynamic test or a creep; None without one
    choice: LawChoice | None = None  # how `law` auto chose the law; None where it was given
    next_specimens: tuple[NextSpecimen, ...] = ()  # of every kind with replicates
    joint: JointSeries | None = None  # whether holds and a dynamic test agree; None where there are not both

    @property
    def series(self) -> Series | None:
        """The fitted Prony series, whatever test it is from."""
        return self.prony or self.spectrum

    @property
    def decisions(self) -> tuple[str, ...]:
        """The sentences of all stages."""
        return tuple(sentence for said in self.stages.values() for sentence in said)


def calibrate(experiments: Sequence[Experiment], options: FitOptions | None = None,
              predicted: Sequence[Experiment] = ()) -> FittedLaws:
    """Fit everything that the experiments allow; `predicted` are stress-strain tests that are compared, not fitted.
    Raises ValueError for an unknown choice or for tests that cannot be fitted or compared."""
    options = options or FitOptions()
    started = time.process_time()
    experiments, said = with_drift([thinned(with_zero(e, options.strain_zero_sd)) for e in experiments])
    relaxing = [e for e in experiments if e.kind == "relaxation"]
    spectrum = _spectrum([e for e in experiments if e.kind in ("dma", "creep")], relaxing, options)
    curves = weigh(experiments, options.residual, options.weights)
    options, choice = chosen_law(curves, options, partial(_with_first_series, relaxing=relaxing, spectrum=spectrum,
                                                          options=options))
    fitter = fitter_of(options, choice.law if choice else None)
    prony = _prony(relaxing, curves, options, fitter) if relaxing else None
    joint = None
    if prony is not None and spectrum is not None:
        alone, (sweep,) = prony, [e for e in experiments if e.kind == "dma"]
        prony = _prony(relaxing, curves, options, fitter, together(sweep, spectrum, alone))
        joint, spectrum = joint_series(alone, spectrum, prony), joined(spectrum, prony)
    series = prony or spectrum
    series_s = time.process_time() - started
    law, uncertainty, softening, how = None, None, None, ()
    if curves:
        law, how = _law(curves, series, fitter)
        uncertainty = linearised(law, series)
        how = (*(choice.sentences if choice else ()), *how, *uncertainty.decisions)
        softening = fit_softening(experiments, law.law, uncertainty, series.prony if series else None)
        how = (*how, *(softening.decisions if softening else ()))
    kept_out = _predicted(predicted, law, series)
    law_s = time.process_time() - started - series_s
    stretched = [e for e in experiments if e.kind == "conductivity"]
    skin = fit_conductivity(stretched, options.conduction) if stretched else None
    total = time.process_time() - started
    data = check_data(law.curves, law.law.hencky_ratio == (0.0, True)) if law else ()
    checks = (*_stiffness_sentences(prony), *_stability_sentences(law, data), *_predicted_sentences(kept_out)
              ) if law else ()
    stages = {"records": said, "relaxation": _series_sentences(series, spectrum if joint else None), "law": how,
              "checks": checks, "skin": skin.decisions if skin else ()}
    spent = {"prony": series_s, "hyperfoam": law_s, "conductivity": total - series_s - law_s, "all": total}
    both = two_nu(law, series) if law else None
    return FittedLaws(tuple(experiments), law, uncertainty, prony, skin, stages, spent, kept_out, data, both,
                      softening, spectrum, choice, next_specimens(law.curves, law.law) if law else (), joint)


def _spectrum(found: Sequence[Experiment], relaxing: Sequence[Experiment], options: FitOptions) -> SpectrumFit | None:
    """The series of the dynamic test or the creep alone; ValueError for two of them, or for a creep with a hold."""
    if not found:
        return None
    if len(found) > 1 or (relaxing and found[0].kind == "creep"):
        names = ", ".join(name for e in (*found, *relaxing) for name in e.source)
        raise ValueError(f"{names}: one dynamic test is fitted with holds and tables of relaxation; a creep, or a "
                         "second dynamic test, is not. Fit each to a card of its own, compare these (matcal compare; "
                         "relaxation by matcal predict), and use the one whose times are those of your loads.")
    reference = None if options.reference_C is None else options.reference_C + 273.15
    # next to holds it says the noise, and whether both agree, whose rule was tested with given times
    return fit_spectrum(found[0], options.prony_terms, options.prony_times_s, reference, search=not relaxing)


def _with_first_series(curves: Sequence[Curve], relaxing: Sequence[Experiment], spectrum: SpectrumFit | None,
                       options: FitOptions) -> Sequence[Curve]:
    """The curves of a rubber whose law is not chosen yet, with the histories of a series through a neo-Hookean law."""
    if not (relaxing or spectrum) or all(c.experiment.time_s is None for c in curves):
        return curves
    law = fitter_of(replace(options, law="neo_hooke", poisson=0.5)).shape(curves)
    first = spectrum or fit_prony(relaxing, law, options.prony_terms, options.prony_times_s)
    return [with_history(c, first.prony) for c in curves]


def _prony(relaxing: Sequence[Experiment], curves: Sequence[Curve], options: FitOptions, fitter: Fitter,
           more: Together = ALONE) -> PronyFit:
    """Series through the shape of the law, which is fitted again with each series until they agree."""
    if not curves:
        return fit_prony(relaxing, None, options.prony_terms, options.prony_times_s, more)
    law = fitter.shape(curves)
    first = fit_prony(relaxing, law, options.prony_terms, options.prony_times_s, more)
    law = _corrected(curves, first, fitter)
    # chosen again, through a law that knows its rate
    found = chosen = fit_prony(relaxing, law, options.prony_terms, options.prony_times_s, more)
    terms, left = chosen.prony.g.size, np.inf
    for turn in range(3, _TURNS + 1):
        law = _corrected(curves, found, fitter)
        before, found = found.prony, fit_prony(relaxing, law, terms, options.prony_times_s, more)
        left = float(np.abs(found.prony.g - before.g).max()) if found.prony.g.size == before.g.size else np.inf
        if left < _SETTLED:
            return _with_decisions(found, chosen, options, _turn_sentences(turn, relaxing, law))
    return _with_decisions(found, chosen, options,
                           [f"Series and law still changed after {_TURNS} turns by {left:.1g} in g."])


def _series_sentences(series: Series | None, sweep: SpectrumFit | None) -> tuple[str, ...]:
    return (*(series.decisions if series else ()), *(sweep.decisions if sweep else ()))


def _corrected(curves: Sequence[Curve], found: PronyFit, fitter: Fitter) -> Law:
    return fitter.shape([with_history(c, found.prony) for c in curves])


def _with_decisions(found: PronyFit, chosen: PronyFit, options: FitOptions, more: Sequence[str]) -> PronyFit:
    """The last turn with the numbers of terms tried when their number was chosen."""
    tried = [] if options.prony_times_s else order_sentences(options.prony_terms, chosen.orders, chosen.prony.g.size)
    return replace(found, orders=chosen.orders, decisions=(*tried, *found.decisions, *more))


def _turn_sentences(turns: int, relaxing: Sequence[Experiment], law: Law) -> list[str]:
    out = [f"Series and law were fitted by turns until they agreed, {turns} turns."]
    deepest = min(float(e.strain.min()) for e in relaxing)
    if deepest < law.strain_range.get("uniaxial", (0.0, 0.0))[0] - 0.02:
        out.append(f"The relaxation test reaches a strain of {deepest:.2f}, outside the compression curve in hand: the "
                   "shape of its ramp is an extrapolation.")
    return out


def _law(curves: tuple[Curve, ...], prony: Series | None, fitter: Fitter) -> tuple[Fit, tuple[str, ...]]:
    curves = tuple(with_history(c, prony.prony) for c in curves) if prony else curves
    curves = curves if fitter.seeks_load_zero else tuple(without_load_zero(c) for c in curves)
    curves = _with_factors(curves, fitter)
    curves = _refined(curves, fitter)
    found = fitter.fit(curves)
    return found, (_moduli_sentence(curves, prony.prony if prony else None), *factor_sentences(curves),
                   *moved_sentences(curves), *found.decisions)


def _with_factors(curves: tuple[Curve, ...], fitter: Fitter) -> tuple[Curve, ...]:
    """Replicates with the factors of their specimens, from laws that are fitted without and then with them."""
    for _ in range(_FACTOR_TURNS if replicated(curves) else 0):
        curves = with_factors(curves, fitter.quick(curves).law)
    return curves


def _refined(curves: tuple[Curve, ...], fitter: Fitter) -> tuple[Curve, ...]:
    """The curves with zeros of strain and load, and drift, refined, by the order that needs least to explain them. A
    term too many takes up what is an error of the record: each lower order of nearly the same residual refines the
    records its own way, and the criterion of orders decides, the corrections' own prior counted."""
    if not any(uncertain(curve) for curve in curves):
        return curves
    first = fitter.quick(curves)
    best = _by_turns(first, fitter)
    if not first.orders:
        return best
    chosen = next(row for row in first.orders if row.order == first.law.alpha.size)
    near = [row.order for row in first.orders if row.order < chosen.order and row.rms < NEARLY * chosen.rms]
    if not near:
        return best
    tried = {n: _by_turns(fitter.quick(curves, n), fitter) for n in near} | {chosen.order: best}
    return min(tried.values(), key=lambda refined: min(
        row.bic for row in fitter.quick(refined).orders) + surprise(refined))


def _by_turns(fit: Fit, fitter: Fitter) -> tuple[Curve, ...]:
    """The refined records of a fit, and of the fits to them, until they settle."""
    curves, most = refined_records(fit)
    for _ in range(_RECORD_TURNS - 1):
        if most < _NEARLY_STILL:
            break
        fit = fitter.again(curves, fit.law)
        curves, most = refined_records(fit)
    return curves


def _moduli_sentence(curves: Sequence[Curve], prony: Prony | None) -> str:
    if prony is None:
        return ("Moduli are labelled long-term: no relaxation file was given, so the stress that has not relaxed yet "
                "at the rate of these tests is not corrected for and counts as long-term.")
    loose = [c for c in curves if c.kernel is None]
    said = (f"Moduli are long-term, corrected for rate: each test's own history is convolved with the Prony series on "
            f"its second Piola-Kirchhoff stress, then mu_longterm = {prony.g_infinity:.4f} mu_instantaneous.")
    for fact, why in (("clock_left_out_s", "Not corrected, since the loading that counts begins under stress"),
                      (CROSSED_S, "Not corrected, since the path crosses from tension to compression")):
        if named := [c.label for c in loose if fact in c.experiment.facts]:
            said += f" {why}: {', '.join(named)}."
    without = [c.label for c in loose if not {"clock_left_out_s", CROSSED_S} & set(c.experiment.facts)]
    return said + (f" No time column, taken as long-term: {', '.join(without)}." if without else "")


def _stiffness_sentences(prony: PronyFit | None) -> list[str]:
    if prony is None:
        return []
    ratios = ", ".join(f"{a * prony.prony.g_infinity:.3f}" for a in prony.amplitude)
    return [f"Held stress over what the law gives there: {ratios}; only the shape of the hold was fitted, so this "
            "compares one specimen with another."]


def _stability_sentences(found: Fit, data: Sequence[DataCheck]) -> list[str]:
    lost = unstable_within(found.law, found.curves)
    said = [f"The law is not {CRITERION_NAMES[criterion]} in {mode} for strains {lo:.3f} to {hi:.3f}, within the tests."
            for criterion, modes in lost.items() for mode, ranges in modes.items() for lo, hi in ranges]
    fitted = ", ".join(f"{mode} {lo:.3g} to {hi:.3g}" for mode, (lo, hi) in found.law.strain_range.items())
    if not said:
        said.append(f"The law is Drucker stable and strongly elliptic along all fitted tests: {fitted}.")
    return [*said, *check_sentences(data, found.law.hencky_ratio == (0.0, True))]


def _predicted(experiments: Sequence[Experiment], found: Fit | None, prony: Series | None) -> tuple[Predicted, ...]:
    if not experiments:
        return ()
    if found is None:
        raise ValueError("a test can only be predicted by a fitted law: give a uniaxial or shear file to fit as well.")
    if strange := [e for e in experiments if not is_curve(e)]:
        raise ValueError(f"{', '.join(strange[0].source)}: a {strange[0].kind} test cannot be predicted and compared; "
                         f"known: {', '.join(MODES)}.")
    curves = weigh([thinned(e) for e in experiments])
    curves = tuple(with_history(c, prony.prony) for c in curves) if prony else curves
    laws = {"combined": found.law} | {f"{mode} alone": alone.law for mode, alone in found.alone.items()}
    return predictions(laws | ({"free": found.free} if found.free else {}), curves)


def _predicted_sentences(predicted: Sequence[Predicted]) -> list[str]:
    return [f"Not fitted but predicted, {', '.join(p.curve.experiment.source)} ({p.curve.experiment.kind} "
            f"{p.curve.experiment.strain.min():.3g} to {p.curve.experiment.strain.max():.3g}): relative RMS "
            + ", ".join(f"{percent(share)} by the {name} law" for name, share in p.relative_rms.items()) + "."
            for p in predicted]


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
