"""How many terms a hyperfoam law should have, and when its single parameters mean nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from matcal.varpro import Optimum

Array = NDArray[np.float64]

# single moduli beyond this many times mu_0 count as exploding
EXPLODING = 50.0
# share of the rms of a lower order to which a term that merges with another must bring it to be worth having
WORTH = 0.9


@dataclass(frozen=True)
class OrderRow:
    """One order tried."""

    # number of terms
    order: int
    # root of the weighted mean square residual (the relative RMS of all curves under the default weights)
    rms: float
    # Bayesian information criterion n ln(rms^2) + (number of parameters) ln n
    bic: float
    # what makes its single parameters meaningless, or ""
    confluence: str


def chosen_order(rows: Sequence[OrderRow]) -> OrderRow:
    """The order of least BIC; where its parameters merge, the best lower order of nearly the same rms (WORTH)."""
    best = min(rows, key=lambda row: row.bic)
    if not best.confluence:
        return best
    clear = [r for r in rows if r.order < best.order and not r.confluence and r.rms < best.rms / WORTH]
    return min(clear, key=lambda row: row.bic, default=best)


def confluence(mu_Pa: Array, alpha: Array, least: float) -> str:
    """Why single parameters are not to be read, or "" where they may be."""
    gap = np.diff(alpha)
    if gap.size and gap.min() < 1.01 * least:
        k = int(np.argmin(gap))
        return f"exponents {k + 1} and {k + 2} have merged to the least distance of {least:.2g} that is allowed"
    if np.abs(mu_Pa).max() > 0.99 * EXPLODING * abs(mu_Pa.sum()):
        return f"single moduli reach {np.abs(mu_Pa).max() / abs(mu_Pa.sum()):.0f} times their sum"
    return ""


def order_sentences(order: int | str, rows: tuple[OrderRow, ...], chosen: OrderRow, optimum: Optimum) -> list[str]:
    """What was tried, what was chosen and why, one sentence each; `optimum` is that of the chosen order."""
    table = ", ".join(f"N = {r.order}: {r.rms:.3%}, BIC {r.bic:.0f}" for r in rows)
    out = [f"Order {chosen.order}, {'by BIC' if order == 'auto' else 'as given'} (weighted RMS {table})."]
    if optimum.unbounded is not None:
        out.append(_bound_sentence(chosen, *optimum.unbounded))
    if chosen.confluence:
        out.append(f"At order {chosen.order} {chosen.confluence}: single mu and alpha are not measurable, read mu_0, "
                   "E_0 and the stress bands." + _clear_words(rows, chosen))
    out += [f"Order {r.order} was passed over: it lowers the residual by less than a tenth and {r.confluence}."
            for r in rows if r is not chosen and r.confluence and r.bic < chosen.bic]
    return out


def _clear_words(rows: tuple[OrderRow, ...], chosen: OrderRow) -> str:
    clear = [r for r in rows if not r.confluence and r.order < chosen.order]
    if not clear:
        return ""
    best = min(clear, key=lambda row: row.bic)
    return (f" Order {best.order} is the best whose parameters can be read (weighted RMS {best.rms:.3%}) and may be "
            "the safer one outside the tests.")


def _bound_sentence(chosen: OrderRow, free_cost: float, free_mu_0_Pa: float) -> str:
    why = (f"its mu_0 is not positive ({free_mu_0_Pa:.4g} Pa; the record may begin with a toe)" if free_mu_0_Pa <= 0
           else f"single moduli exceed {EXPLODING:.0f} mu_0")
    return (f"The best moduli of order {chosen.order} are no material, {why}: held to |mu_i| <= {EXPLODING:.0f} mu_0, "
            f"weighted RMS {chosen.rms:.3%} instead of {np.sqrt(free_cost):.3%}.")
