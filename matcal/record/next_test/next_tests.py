"""The test that narrows a quantity most, by how the card's open laws let its result and the quantity vary together.

With deviations a of the quantity and A of what a test would measure (`matcal.record.next_test.open_laws`), and the
noise R of the test, one law's quantity moves by a'A (A'A + R)^-1 (y - f) where the test gives y for its own f, and its
variance falls from a'a to a'a - a'A (A'A + R)^-1 A'a. Of several laws each is taken to be right in turn, with its
weight: the others follow it as far as their parameters allow, misfit counts as noise, and what they predict wrongly
takes weight from them as in `matcal.fitting.law_ranking`; variance within and between laws is left. Linear in each law,
and exact for normal ones. Source: Chaloner & Verdinelli, Stat. Sci. 10 (1995) 273, DOI 10.1214/ss/1177009939.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from matcal.card import MaterialCard, as_card
from matcal.fitting.law_ranking import support
from matcal.record.next_test.candidates import Test, candidates, noise, points_of_one, predicted
from matcal.record.next_test.open_laws import OpenLaw, Spread, open_laws
from matcal.record.next_test.quantities import aim_of, named
from touchcal.arrays import Array

_SPECIMENS = 3  # of the best test, as a further proposal
_MISFIT_POINTS = 3.0  # independent points of what a law cannot follow, which is smooth
_REACH = 1.96  # standard deviations to either side that hold 95 % of a normal number


@dataclass(frozen=True)
class Worth:
    """A test and what it is expected to do."""

    test: Test
    sd: float  # expected standard deviation of the quantity after it, in its own unit
    narrows_by: float  # share of its interval that goes
    minutes: float | None = None  # that it takes, all specimens together; None where that was not given


@dataclass(frozen=True)
class NextTests:
    """What the card says of a quantity, and tests that would narrow it, the best first."""

    quantity: str  # with its unit
    value: float  # mean over the laws that are open
    sd: float
    between_laws: float  # share of the variance between laws of several kinds
    tests: tuple[Worth, ...]
    scatter_known: bool  # whether replicates showed how much specimens differ

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of its 95 % interval, as of a normal number."""
        return self.value - _REACH * self.sd, self.value + _REACH * self.sd

    @property
    def families(self) -> tuple[Worth, ...]:
        """The best test of each family with one specimen, then the first of them with several."""
        best: dict[tuple[object, ...], Worth] = {}
        for each in self.tests:
            best.setdefault((each.test.family, each.test.specimens > 1), each)
        return tuple(best.values())


def next_tests(card: MaterialCard | Path | str, quantity: str = "mu_0", *,
               minutes: Mapping[str, float] | None = None) -> NextTests:
    """Which further test is expected to narrow a quantity of a card most.

    Parameters
    ----------
    card
        A card of `matcal.fit`, or its file: by the draws of its posterior, which a card with a series needs, else by
        the laws that were compared, else by the covariance of its law.
    quantity
        `mu_0`, `E_0`, `plateau`, with a series `g_infinity` and `mu_0_instantaneous`, `nu` where it was sampled;
        `stress:MODE:STRAIN` for the nominal stress of a mode; `touch:SCENE` for the depth of the touch of a scene file.
    minutes
        Kind of test -> what one specimen takes, min; tests are then in the order of ln(sd before/sd after) a minute,
        and kinds without an entry are left out. None: in the order of what they narrow.

    Returns
    -------
    NextTests
        Every candidate with the standard deviation that is expected after it.

    Raises
    ------
    ValueError
        Where the card does not say what is open, or for an unknown quantity or kind.

    Examples
    --------
    >>> import matcal
    >>> card = matcal.fit("data_raw/uniaxial.csv", order=1).card
    >>> worth = matcal.next_tests(card, "stress:shear:0.5").tests[0]
    >>> worth.test.kind, worth.narrows_by > 0.3
    ('shear', True)
    """
    card = as_card(card)
    laws = open_laws(card)
    name, of_draws = named(quantity, card, laws)
    own = [law.spread(of_draws) for law in laws]
    if not all(np.all(np.isfinite(rows)) for _, rows in own):
        raise ValueError(f"`for` {quantity}: not every law that the card leaves open has this value. Choose a smaller "
                         "strain, or a touch of less force.")
    omega, listed = _omega(laws), [*candidates(card, laws[0].draws, aim_of(quantity, card))]
    if minutes is not None:
        _check_minutes(minutes, list(dict.fromkeys(test.kind for test in listed)))
        listed = [test for test in listed if test.kind in minutes]
    weight = np.array([law.weight for law in laws]) / sum(law.weight for law in laws)
    means, within = np.array([mean[0] for mean, _ in own]), np.array([rows[:, 0] @ rows[:, 0] for _, rows in own])
    value, variance = float(weight @ means), _variance(weight, means, within)

    def worth(test: Test) -> Worth | None:
        seen = [law.spread(lambda draws: predicted(test, draws, card)) for law in laws]
        if not all(np.all(np.isfinite(rows)) and np.all(np.isfinite(mean)) for mean, rows in seen):
            return None  # a law that is open has no answer
        errors = noise(test, card, weight @ np.stack([mean for mean, _ in seen]), omega)
        sd = _left(weight, own, seen, errors, points_of_one(card)) ** 0.5
        return Worth(test, sd, 1 - sd / variance**0.5 if variance > 0 else 0.0,
                     None if minutes is None else minutes[test.kind] * test.specimens)

    rows = _ordered([row for test in listed if (row := worth(test)) is not None])
    rows += [row for best in (rows[:1] if omega else ())
             if (row := worth(replace(best.test, specimens=_SPECIMENS))) is not None]
    between = 1 - float(weight @ within) / variance if variance > 0 and len(laws) > 1 else 0.0
    return NextTests(name, value, variance**0.5, between, tuple(_ordered(rows)), omega > 0)


def _left(weight: Array, own: Sequence[Spread], seen: Sequence[Spread], errors: Array, points: float) -> float:
    """Variance of the quantity that is expected after the test, over the laws that may be right."""
    if len(own) == 1:
        return _followed(own[0], seen[0], seen[0][0], errors, points)[1]
    out = 0.0
    for share, (right, _) in zip(weight, seen, strict=True):
        size = np.sqrt(np.mean(right**2))
        missed = [float(np.sqrt(np.mean((mean - right) ** 2)) / size) for mean, _ in seen]
        after = weight * [support(miss, min(missed)) for miss in missed]
        moved = [_followed(a, y, right, errors, points) for a, y in zip(own, seen, strict=True)]
        out += share * _variance(after / after.sum(), *np.transpose(moved))
    return out


def _followed(own: Spread, seen: Spread, right: Array, errors: Array, points: float) -> tuple[float, float]:
    """Quantity of a law, and its variance, after a test that gave `right`; what it cannot follow is noise to it."""
    (mean, rows), (model, measured) = own, seen
    size = np.sqrt(np.diag(errors))
    a, seen_rows, missed = rows[:, 0], measured / size, (right - model) / size
    noisy = errors / np.outer(size, size)
    normal = seen_rows.T @ seen_rows + noisy
    left = noisy @ cho_solve(cho_factor(normal), missed)
    misfit = np.mean(left**2) * missed.size / min(points, _MISFIT_POINTS)
    total = cho_factor(normal + misfit * np.eye(missed.size))
    common = seen_rows.T @ a
    return (float(mean[0] + common @ cho_solve(total, missed)),
            max(float(a @ a - common @ cho_solve(total, common)), 0.0))


def _variance(weight: Array, means: Array, within: Array) -> float:
    """Variance within and between laws."""
    return float(weight @ within + weight @ (means - weight @ means) ** 2)


def _ordered(rows: list[Worth]) -> list[Worth]:
    return sorted(rows, key=lambda row: -row.narrows_by if row.minutes is None
                  else np.log1p(-min(row.narrows_by, 1 - 1e-12)) / row.minutes)


def _omega(laws: tuple[OpenLaw, ...]) -> float:
    """Scatter of ln stiffness between specimens, in the root mean square; 0 where no replicates show it."""
    omega = laws[0].draws.omega
    return 0.0 if omega is None else float(np.sqrt(np.mean(omega**2)))


def _check_minutes(minutes: Mapping[str, float], known: Sequence[str]) -> None:
    if unknown := sorted(set(minutes) - set(known)):
        raise ValueError(f"minutes for '{unknown[0]}': no such test is proposed for this card; there are: "
                         f"{', '.join(known)}.")
    if bad := [kind for kind, value in minutes.items() if not (np.isfinite(value) and value > 0)]:
        raise ValueError(f"minutes {bad[0]}={minutes[bad[0]]:g} must be a positive number.")
