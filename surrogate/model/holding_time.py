"""Forces of a touch that has been held for a time, from a model of another state of relaxation.

What the voltages see is the deformation. At a fixed one, loaded at once, the foam's stresses are S(t) = S_0 G(t)/G_0
with the card's Prony series, and those of a model of long-term moduli are S_0 G_inf/G_0.
"""

import numpy as np

from matcal.laws.prony import Prony, relaxation
from surrogate.model.trained import TrainedModel

STRESSES = ("F", "sigma_max", "sigma_ave")  # outputs that are in proportion to the foam's stress
_SAID_S = (1.0, 10.0, 60.0)  # times at which a caution says how much stiffer the foam is


def stress_left(model: TrainedModel, held_s: float | None) -> float:
    """G(held_s)/G of the model's moduli; 1 where no time is given. ValueError for a time below 0, or a model whose data
    set tells no relaxation of touches that are loaded at once."""
    if held_s is None:
        return 1.0
    if not 0 <= held_s < np.inf:
        raise ValueError(f"a holding time must be a finite number of seconds from 0, got {held_s:g}.")
    if not model.record.get("relaxation"):
        raise ValueError("the model tells no relaxation of its foam: its card has no Prony series, its touches are "
                         "held ones already, or it is of an earlier version. Leave the holding time out, or sweep with "
                         "a card that has a series and train again.")
    return _left(model, held_s)


def holding_caution(model: TrainedModel, held_s: float | None) -> str:
    """How far forces may be off by relaxation where no time is given; empty where they are not, or one is."""
    if held_s is not None or not model.record.get("relaxation") or not {*model.names} & {*STRESSES}:
        return ""
    parts = [f"{100 * (_left(model, t) - 1):+.0f} % after {t:g} s" for t in _SAID_S]
    moduli = "long-term" if model.record["relaxation"]["moduli"] == "longterm" else "instantaneous"
    return (f"F is that of {moduli} moduli, as if the foam had relaxed so far; by the card's Prony series a touch that "
            f"was loaded at once takes {', '.join(parts)}. Give the time since loading (--held SECONDS, held_s=).")


def _left(model: TrainedModel, held_s: float) -> float:
    told = model.record["relaxation"]
    series = Prony(told["g"], told["tau_s"])
    return float(relaxation(series, held_s)) / (series.g_infinity if told["moduli"] == "longterm" else 1.0)
