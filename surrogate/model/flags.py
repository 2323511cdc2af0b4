"""What is to be known of a frame, as kinds; sentences are made where a table is written."""

from collections.abc import Mapping
from enum import IntFlag


class Flag(IntFlag):
    """Kinds of what is to be known of a frame, in the order of their sentences."""

    NO_TOUCH = 1
    OUTSIDE = 2  # the touch, or the signal's size, lies outside what was trained
    MISFIT = 4  # no touch explains the signal
    OTHER_PUNCH = 8
    GAIN = 16  # a channel's gain explains what no touch does
    OTHER_SIGN = 32  # where nearly all trained touches lower the readings, or nearly all raise them
    SEVERAL = 64


WORDS = {
    Flag.NO_TOUCH: "no touch", Flag.OUTSIDE: "outside the training range", Flag.MISFIT: "unlike the trained touches",
    Flag.OTHER_PUNCH: "the diameter may lie outside the trained ones", Flag.GAIN: "as if a channel's gain had drifted",
    Flag.OTHER_SIGN: "signal of the other sign than a touch's", Flag.SEVERAL: "several answers for F"}


def in_words(kinds: int, detailed: Mapping[Flag, str]) -> str:
    """The sentences of some kinds, those that are detailed by what is more exact of this frame."""
    return "; ".join(detailed.get(one, WORDS[one]) for one in Flag if kinds & one)
