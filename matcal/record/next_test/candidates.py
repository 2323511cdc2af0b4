"""Tests that a lab can make, what the open laws predict of each, and how well it would be measured.

The noise of a test is that of the card's own: the relative residual of its mode, else the mean of all, yet no less
stress than the card's own residuals where stress is least, and as many independent points as the fit counted in one
test. A further specimen
has a stiffness of its own where replicates showed how much specimens differ, and errors of contact point, load zero and
drift of its own where the records state how well theirs are known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from matcal.card import MaterialCard
from matcal.laws.deformation_modes import MODES, hereditary_stress, lateral_strain, modes_of, nominal_stress
from matcal.laws.law import scaled
from matcal.laws.prony import Prony, relaxation
from matcal.posterior.drawn_laws import law_of, stress_of
from matcal.posterior.draws import Draws
from matcal.record.bands import spans
from matcal.record.cautions import own_rms, tests
from touchcal.arrays import Array

_POINTS, _SHARES = 21, (0.25, 0.5, 1.0)  # points of a test; shares of the strains of a mode to which it may go
_REPEATED = 0.5  # share of the strains of a test that were tested, from which on it repeats
_LEAST = 0.02  # strain below which no test is proposed
# rate of a slow test over that of the card's own; a long hold over the longest time of the series
_SLOW, _LONG = 0.1, 10.0
_NOISE = 0.01  # relative residual of a card that states none
RELAXATION = "relaxation"


@dataclass(frozen=True)
class Test:
    """One test that a lab can make."""

    kind: str  # one of the modes, or relaxation
    strain_to: float  # nominal strain at its end (gamma in shear, J in volumetric)
    ramp_s: float | None = None  # duration of its ramp; None where the card has no series: the law's own stress
    slow: bool = False  # slower than the card's own tests
    hold_s: float | None = None  # duration of the hold of a relaxation
    lateral: bool = False  # whether the free faces are measured too
    specimens: int = 1  # each tested once

    @property
    def family(self) -> tuple[str, bool, bool, bool]:
        """Tests that differ in size alone."""
        return self.kind, self.strain_to > _rest(self.kind), self.lateral, self.slow

    @property
    def strains(self) -> Array:
        """(n,) from rest, without it."""
        return np.linspace(_rest(self.kind), self.strain_to, _POINTS + 1)[1:]


def candidates(card: MaterialCard, draws: Draws, aim: tuple[str, float] | None = None) -> Iterator[Test]:
    """All modes of the law in both directions, up to the strains over which the card gives its band; with lateral
    strains where nu is open; slower, and holds, where the card relaxes. Strains that were tested are repeated only
    where replicates showed how much specimens differ: without, no one can say what a further specimen will do. `aim`:
    mode and strain whose stress is asked for, to which tests of the mode go in any case."""
    law = card.law
    assert law is not None
    if not law.strain_range:
        raise ValueError(f"card '{card.name}' does not say over which strains it was fitted (strain_range), from which "
                         "tests are proposed. Use a card of `matcal fit`.")
    nu, relaxes = draws.law.get("nu"), draws.g is not None and draws.g.size > 0
    for mode, ends in spans(law.strain_range, modes_of(law)).items():
        rest, rate = _rest(mode), _rate(card, mode) if relaxes else None
        for far in (end for end in _reaching(ends, mode, aim) if abs(end - rest) >= _LEAST):
            if mode == "volumetric" and far > rest:  # no lab pulls a specimen from all sides
                continue
            sizes = [Test(mode, rest + share * (far - rest), None if rate is None else share * abs(far - rest) / rate)
                     for share in _SHARES]
            if draws.omega is None and _tested(far, *law.strain_range.get(mode, (rest, rest)), rest):
                continue
            yield from sizes
            if nu is not None and np.ptp(nu) > 1e-9 and mode not in ("shear", "volumetric"):
                yield from (replace(each, lateral=True) for each in sizes)
            if rate is not None:
                yield from (replace(each, ramp_s=(each.ramp_s or 0.0) / _SLOW, slow=True) for each in sizes)
    if relaxes and draws.tau_s is not None:
        slowest = float(np.median(draws.tau_s.max(axis=1)))
        yield from (Test(RELAXATION, _hold_strain(card), hold_s=factor * slowest) for factor in (1.0, _LONG))


def predicted(test: Test, draws: Draws, card: MaterialCard) -> Array:
    """(D, n) what D draws say of a test: stress, Pa, then lateral strain; the normalised stress of a hold."""
    if test.kind == RELAXATION:
        time = np.geomspace(1e-3, 1.0, _POINTS) * (test.hold_s or 0.0)
        return np.stack([relaxation(prony, time) for prony in _series(draws)])
    stress = stress_of(draws, test.kind, test.strains)
    if test.ramp_s is not None:
        stress = stress * _hardening(test, draws, card)
    if not test.lateral:
        return stress
    across = np.stack([lateral_strain(law_of(draws, k), test.kind, test.strains) for k in range(len(draws))])
    return np.hstack([stress, across])


def noise(test: Test, card: MaterialCard, mean: Array, omega: float) -> Array:
    """(n, n) covariance of what would be measured where `mean` (n,) is right; omega: scatter of ln stiffness."""
    share, stress = relative_noise(card, test.kind), mean[:_POINTS]
    variance = np.full(mean.size, share**2 * np.mean(stress**2))
    out = np.zeros((mean.size, mean.size))
    if test.kind != RELAXATION:
        variance = np.maximum(variance, _least_Pa(card) ** 2)
        variance[_POINTS:] = share**2 * np.mean((test.strains - _rest(test.kind)) ** 2)
        zero, load, drift = (record_error(card, test.kind, name)
                             for name in ("strain_zero_sd", "zero_sd_Pa", "drift_sd_Pa_per_s"))
        common = [omega * stress, zero * np.gradient(stress, test.strains), np.full(_POINTS, load),
                  drift * (test.ramp_s or 0.0) * np.linspace(0, 1, _POINTS)]
        out[:_POINTS, :_POINTS] = np.sum([np.outer(each, each) for each in common], axis=0)
    return (out + np.diag(variance * _POINTS / points_of_one(card))) / test.specimens


def relative_noise(card: MaterialCard, kind: str) -> float:
    """Relative residual of the card's own tests of a kind; else of the others of its law, in the mean square."""
    rows = [row for row in tests(card).values() if row["kind"] in (*MODES, RELAXATION)]
    own = [row for row in rows if row["kind"] == kind] or [row for row in rows if row["kind"] != RELAXATION]
    found = [own_rms(row) for row in own]
    return float(np.sqrt(np.mean(np.square(found)))) if any(found) else _NOISE


def _least_Pa(card: MaterialCard) -> float:
    """Residual of the card's own tests where stress is least, Pa, which a load cell leaves in a small test too."""
    return min((float(row.get("rms_at_least_stress", row["rms"])) for row in tests(card).values()
                if row["kind"] in MODES), default=0.0)


def record_error(card: MaterialCard, kind: str, name: str) -> float:
    """Root mean square of what the records of a kind, else of all, state of an error of theirs; 0 where none does."""
    rows = [row for row in tests(card).values() if row["kind"] in MODES]
    own = [row for row in rows if row["kind"] == kind] or rows
    return float(np.sqrt(np.mean([row.get("record", {}).get(name, 0.0) ** 2 for row in own]))) if own else 0.0


def points_of_one(card: MaterialCard) -> float:
    """Independent points of one test: those of the fit, shared by its tests."""
    count = sum(row["kind"] in MODES for row in tests(card).values())
    points = card.posterior.get("checks", {}).get("effective_points") or card.fit.get("effective_points") or _POINTS
    return max(1.0, float(points) / max(count, 1))


def _rest(kind: str) -> float:
    return 1.0 if kind == "volumetric" else 0.0


def _reaching(ends: tuple[float, float], mode: str, aim: tuple[str, float] | None) -> tuple[float, float]:
    return ends if aim is None or aim[0] != mode else (min(ends[0], aim[1]), max(ends[1], aim[1]))


def _tested(far: float, low: float, high: float, rest: float) -> bool:
    """Whether strains from rest to `far` were tested for the most part."""
    reached = high - rest if far > rest else rest - low
    return reached > _REPEATED * abs(far - rest)


def _rate(card: MaterialCard, kind: str) -> float | None:
    """Strain rate, 1/s, of the card's own tests of a kind, else of all; None where no record has a clock."""
    rows = [(row["kind"], float(np.ptp(row["strain_range"])) / row["record"]["duration_s"])
            for row in tests(card).values() if row.get("record", {}).get("duration_s")]
    own = [rate for of, rate in rows if of == kind] or [rate for _, rate in rows]
    return float(np.exp(np.mean(np.log(own)))) if own else None


def _hold_strain(card: MaterialCard) -> float:
    held = [row["strain_range"] for row in tests(card).values() if row["kind"] == RELAXATION]
    return max(held[0], key=abs) if held else 0.0


def _hardening(test: Test, draws: Draws, card: MaterialCard) -> Array:
    """(D, n) stress at the rate of a test over the long-term stress: each draw's series through the card's law."""
    assert card.law is not None
    law = replace(card.law, moduli="instantaneous")
    time, strain = np.linspace(0.0, test.ramp_s or 0.0, _POINTS + 1), np.r_[_rest(test.kind), test.strains]
    stress = [hereditary_stress(scaled(law, 1 / prony.g_infinity), prony, test.kind, time, strain)[1:]
              for prony in _series(draws)]
    return np.stack(stress) / nominal_stress(law, test.kind, test.strains)


def _series(draws: Draws) -> list[Prony]:
    return [] if draws.g is None or draws.tau_s is None else list(map(Prony, draws.g, draws.tau_s))
