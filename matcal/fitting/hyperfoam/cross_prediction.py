"""What a law says about tests that it was not fitted to: laws of one mode alone, and files kept out of the fit."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from matcal.fitting.hyperfoam.curves import Curve
from matcal.laws.law import Law
from matcal.laws.stability import CRITERIA, unstable_ranges
from touchcal.errors import NotConverged

# points at which the range of a curve is scanned for lost stability
_SCANNED = 121


@dataclass(frozen=True)
class Alone:
    """The law fitted to one mode only, and how it predicts the others."""

    # fitted law
    law: Law
    # mode -> relative RMS there
    relative_rms: Mapping[str, float]
    # label of a curve -> relative RMS there
    relative_rms_of: Mapping[str, float]
    # criterion -> mode -> [[lo, hi], ...] of nominal strain within the curves where this law is not stable
    unstable: Mapping[str, Mapping[str, list[list[float]]]]


@dataclass(frozen=True)
class Predicted:
    """A test that was kept out of the fit, and what the laws say about it."""

    # the test, with the history that the law sees
    curve: Curve
    # name of a law ("combined", "uniaxial alone", ...) -> relative RMS
    relative_rms: Mapping[str, float]


def relative_rms(law: Law, curve: Curve) -> float:
    """rms(residual)/rms(stress) of a law on a curve."""
    stress = curve.experiment.value
    return float(np.sqrt(np.mean((stress - curve.model(law))**2) / np.mean(stress**2)))


def kinds_of(curves: Sequence[Curve]) -> list[str]:
    """Kinds of the curves, each once, in order."""
    return list(dict.fromkeys(c.experiment.kind for c in curves))


def each_alone(curves: Sequence[Curve], law_of: Callable[[tuple[Curve, ...]], Law]) -> dict[str, Alone]:
    """Mode -> law of that mode alone by `law_of`, with its errors in all of `curves`; empty with one mode, and without
    laws that have no state there."""
    kinds = kinds_of(curves)
    out: dict[str, Alone] = {}
    for kind in kinds if len(kinds) > 1 else []:
        law = law_of(tuple(c for c in curves if c.experiment.kind == kind))
        try:
            each = {c.label: relative_rms(law, c) for c in curves}
        except NotConverged:
            continue
        if not np.all(np.isfinite([*each.values()])):
            continue
        of_kind = {k: float(np.sqrt(np.mean([each[c.label]**2 for c in curves if c.experiment.kind == k])))
                   for k in kinds}
        out[kind] = Alone(law, of_kind, each, unstable_within(law, curves))
    return out


def unstable_within(law: Law, curves: Sequence[Curve]) -> dict[str, dict[str, list[list[float]]]]:
    """Criterion -> mode -> ranges of strain [[lo, hi], ...] that the curves cover and where the law is not stable."""
    out: dict[str, dict[str, list[list[float]]]] = {}
    for criterion in CRITERIA:
        for kind in kinds_of(curves):
            e = np.concatenate([c.experiment.strain for c in curves if c.experiment.kind == kind])
            strain = np.linspace(e.min(), e.max(), _SCANNED)
            ranges = unstable_ranges(law, criterion, kind, strain)
            if ranges:
                out.setdefault(criterion, {})[kind] = ranges
    return out


def predictions(laws: Mapping[str, Law], curves: Sequence[Curve]) -> tuple[Predicted, ...]:
    """Errors of the named laws on curves that none of them was fitted to."""
    return tuple(Predicted(c, {name: relative_rms(law, c) for name, law in laws.items()}) for c in curves)


def alone_sentences(curves: Sequence[Curve], alone: Mapping[str, Alone], *, exponents: bool = True) -> list[str]:
    """What fits to one mode mean here, one sentence each; exponents: whether the law is one of powers of stretches."""
    kinds, out = kinds_of(curves), []
    if len(kinds) == 1:
        out.append(f"Only {kinds[0]} was fitted: no cross prediction is possible, and other modes are extrapolated and "
                   "may be far off.")
    if exponents and "shear" in kinds and (alone or len(kinds) == 1):
        out.append(f"{'The law of shear' if alone else 'Shear'} alone is even in each exponent: their signs are taken "
                   "as positive, not measured, and what it says about compression and tension rests on that.")
    for kind, found in alone.items():
        for criterion, modes in found.unstable.items():
            where = ", ".join(f"{mode} " + " and ".join(f"{lo:.3g} to {hi:.3g}" for lo, hi in ranges)
                              for mode, ranges in modes.items())
            out.append(f"The law fitted to {kind} alone is not {criterion} stable within the tests: {where}.")
    return out
