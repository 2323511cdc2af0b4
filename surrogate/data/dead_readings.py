"""Which readings are none, how many of these a frame may have and still be read, and what that costs, in words."""

from collections.abc import Callable

import numpy as np

from touchcal.arrays import Array, Mask

MOST = 1e12  # no instrument reads more, in volts or in counts
MOST_DEAD = 0.5  # most readings, as a part of all, that a model can do without
NAMED = 4  # channels that are named, at most
Names = tuple[str, ...]  # (m,) of the columns in their file; empty where it has none of its own
Costs = dict[str, tuple[float, float, str]]  # mean error of each output without and with some channels, its unit


def none(readings: Array) -> Mask:
    """Which readings are no number, or none that an instrument reads."""
    return ~(np.abs(readings) <= MOST)


def too_many(dead: Mask) -> str:
    """In words, that too many readings (m,) of a frame are dead; empty where they are not."""
    return (f"{dead.sum()} of {len(dead)} readings are dead, and half or more are needed"
            if np.mean(dead) > MOST_DEAD else "")


def teaching_nothing(dead: Mask, fewest: int) -> Mask:
    """(m,) channels to be left out altogether of rows (n, m) of dead readings: those dead in most rows and then, one
    after the other until `fewest` rows are whole, the one dead in most of them."""
    often = dead.mean(axis=0)
    out = often > MOST_DEAD
    while np.sum(~dead[:, ~out].any(axis=1)) < fewest and often[~out].any():
        out[np.argmax(np.where(out, 0.0, often))] = True
    return out


def named(dead: Mask, columns: Names = ()) -> str:
    """In words, which channels of a mask (m,) are dead, by the names of their columns, v_000 ... where these have none
    of their own, and the verb."""
    names = [columns[channel] if columns else f"v_{channel:03d}" for channel in np.flatnonzero(dead)]
    more = f" and {len(names) - NAMED} more" * (len(names) > NAMED)
    return f"{', '.join(names[:NAMED])}{more} {'is' if len(names) == 1 else 'are'}"


def cost_said(dead: Mask, by: str, costs: Costs, columns: Names) -> str:
    """In words, that frames are read without the channels of a mask (m,), and what that costs by the rows that tell
    it."""
    return f"{named(dead, columns)} dead and left out, and intervals are wider for it; {errors_said(by, costs)}"


def errors_said(by: str, costs: Costs) -> str:
    """In words, the mean error without and with some channels of each output in which three digits differ, by the rows
    that tell it."""
    digits = {name: (f"{without:.3g}", f"{whole:.3g}", unit) for name, (without, whole, unit) in costs.items()}
    changed = [f"{name} about {without} {unit} without, {whole} with" for name, (without, whole, unit) in digits.items()
               if without != whole]
    if not changed:
        return f"mean errors by the {by} are the same without and with"
    same = ", ".join(name for name, (without, whole, _) in digits.items() if without == whole)
    return f"mean error by the {by}: {', '.join(changed)}" + f"; unchanged: {same}" * bool(same)


def most_lacked(dead: Mask, channels: int, words: Callable[[Mask], str]) -> str:
    """What `words` says of those that most frames of masks (n, channels + more) lack, and of how many; empty where no
    channel is dead, or too many are."""
    lacking = [one.any() and not too_many(one) for one in dead[:, :channels]]
    if not any(lacking):
        return ""
    masks, count = np.unique(dead[lacking], axis=0, return_counts=True)
    others = f"; other frames, {sum(lacking) - count.max()} of them, lack other channels" * (len(masks) > 1)
    return f"in {count.max()} of {len(dead)} frames {words(masks[count.argmax()])}{others}."


class SaidOnce:
    """Says what dead channels of a stream cost, once, when a second frame lacks them."""

    def __init__(self, words: Callable[[Mask, Names], str], say: Callable[[str], object]) -> None:
        self._words, self._say = words, say
        self.columns: Names = ()
        self._before, self._said = b"", {b""}

    def met(self, dead: Mask) -> None:
        """One more frame, which lacks the channels of a mask (m,)."""
        now = dead.tobytes() if dead.any() and not too_many(dead) else b""
        if now == self._before and now not in self._said:
            self._said.add(now)
            self._say(f"{self._words(dead, self.columns)}.")
        self._before = now
