"""How many terms a hyperfoam law should have, and when its single parameters mean nothing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from matcal.fitting.hyperfoam.variable_projection import Optimum
from touchcal.arrays import Array

EXPLODING = 50.0  # single moduli of more than this many times mu_0 count as exploding
WORTH = 0.9  # share of the rms of a lower order to which a term that merges with another must bring it to be worth it
# relative RMS of every curve within which a lower order whose parameters can be read is taken all the same: specimens
# of one foam differ by as much, and merged terms pay for the rest with what they say outside the tests
GOOD_ENOUGH = 0.05
# relative RMS of every curve within which no specimen is known: a stable lower order is taken before one that is not
ACCURATE = 0.005
_PLENTY = 10  # different strains for each parameter below which the correction of BIC for few points is said
# relative residual that no record resolves
RESOLVED = 1e-6


@dataclass(frozen=True)
class OrderRow:
    """One order tried."""

    order: int  # number of terms
    rms: float  # root of the weighted mean square residual (the relative RMS of all curves under the default weights)
    worst: float  # largest relative RMS of a single curve
    bic: float  # see `criterion`
    collinearity: str  # what makes its single parameters meaningless, or ""
    unstable: bool = False  # whether it fits within ACCURATE and loses Drucker stability inside the tests
    nu: float | None = None  # of every term, where it was fitted at this order


def chosen_order(rows: Sequence[OrderRow]) -> OrderRow:
    """The order of least BIC; where its parameters merge or lie on their bound, the best lower order that fits every
    curve within GOOD_ENOUGH or has nearly the same rms (WORTH), if there is one; where it is not stable inside the
    tests, the best stable lower order that fits every curve within ACCURATE: what a further term then follows is what
    neighbouring residuals have in common."""
    best = min(rows, key=lambda row: row.bic)
    lower = [r for r in rows if r.order < best.order and not r.collinearity]
    if best.collinearity:
        clear = [r for r in lower if r.worst < GOOD_ENOUGH or r.rms < best.rms / WORTH]
    else:
        clear = [r for r in lower if best.unstable and r.worst < ACCURATE and not r.unstable]
    return min(clear, key=lambda row: row.bic, default=best)


def criterion(cost: float, parameters: int, count: int, different: int) -> float:
    """Bayesian information criterion n ln(cost) + k ln(n) m/(m - k - 2), k `parameters`, for `count` n residuals at
    `different` m strains; residuals below RESOLVED count as that, so that no term follows rounding. The last factor is
    the correction for few points; it is 1 for many. Source: McQuarrie, Stat. Probab. Lett. 44 (1999) 79,
    DOI 10.1016/S0167-7152(98)00294-6."""
    price = different / max(different - parameters - 2, 1)
    return float(count * np.log(max(cost, RESOLVED**2)) + parameters * np.log(count) * price)


def collinearity(mu_Pa: Array, alpha: Array, least: float) -> str:
    """Why single parameters are not to be read, or "" where they may be."""
    gap = np.diff(alpha)
    if gap.size and gap.min() < 1.01 * least:
        k = int(np.argmin(gap))
        return f"exponents {k + 1} and {k + 2} have merged to the least distance of {least:.2g} that is allowed"
    if np.abs(mu_Pa).max() > 0.99 * EXPLODING * abs(mu_Pa.sum()):
        return f"single moduli reach {np.abs(mu_Pa).max() / abs(mu_Pa.sum()):.0f} times their sum"
    return ""


def order_sentences(order: int | str, rows: tuple[OrderRow, ...], chosen: OrderRow, optimum: Optimum,
                    different: int) -> list[str]:
    """What was tried, what was chosen and why, one sentence each; `optimum` is that of the chosen order, `different`
    the number of different strains."""
    table = ", ".join(f"N = {r.order}: {r.rms:.3%}, BIC {r.bic:.0f}" + ("" if r.nu is None else f", nu {r.nu:.3g}")
                      for r in rows)
    out = [f"Order {chosen.order}, {'by BIC' if order == 'auto' else 'as given'} (weighted RMS {table})."]
    most = 2 * max(r.order for r in rows)
    if order == "auto" and different < _PLENTY * most:
        out.append(f"{different} different strains are few for {most} parameters: BIC charges k of them "
                   f"{different}/({different} - k - 2) times their usual price (McQuarrie 1999).")
    if optimum.unbounded is not None:
        out.append(_bound_sentence(chosen, *optimum.unbounded))
    if chosen.collinearity:
        out.append(f"At order {chosen.order} {chosen.collinearity}: single mu and alpha are not measurable, read mu_0, "
                   "E_0 and the stress bands." + _clear_words(rows, chosen))
    return out + [_passed_sentence(r, chosen) for r in rows if r.order > chosen.order and r.collinearity
                  and r.bic < chosen.bic] + [
        f"Order {r.order} was passed over: it would fit to {r.rms:.3%} instead of {chosen.rms:.3%}, but is not Drucker "
        f"stable inside the tests; --order {r.order} takes it all the same."
        for r in rows if r.order > chosen.order and not r.collinearity and r.unstable and r.bic < chosen.bic]


def _passed_sentence(passed: OrderRow, chosen: OrderRow) -> str:
    why = (f"order {chosen.order} fits every curve within {GOOD_ENOUGH:.0%} (worst {chosen.worst:.2%})"
           if chosen.worst < GOOD_ENOUGH else "it lowers the residual by less than a tenth")
    return (f"Order {passed.order} was passed over: it would fit to {passed.rms:.2%} instead of {chosen.rms:.2%}, but "
            f"{passed.collinearity}, and {why}; --order {passed.order} takes it all the same, and what it then says "
            "outside the tests is not to be trusted.")


def _clear_words(rows: tuple[OrderRow, ...], chosen: OrderRow) -> str:
    clear = [r for r in rows if not r.collinearity and r.order < chosen.order]
    if not clear:
        return ""
    best = min(clear, key=lambda row: row.bic)
    return (f" Order {best.order} (--order {best.order}) is the best whose parameters can be read (weighted RMS "
            f"{best.rms:.3%}) and may be the safer one outside the tests.")


def _bound_sentence(chosen: OrderRow, free_cost: float, free_mu_0_Pa: float) -> str:
    why = (f"its mu_0 is not positive ({free_mu_0_Pa:.4g} Pa; the record may begin with a toe)" if free_mu_0_Pa <= 0
           else f"single moduli exceed {EXPLODING:.0f} mu_0")
    return (f"The best moduli of order {chosen.order} are no material, {why}: held to |mu_i| <= {EXPLODING:.0f} mu_0, "
            f"weighted RMS {chosen.rms:.3%} instead of {np.sqrt(free_cost):.3%}.")
