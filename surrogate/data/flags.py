"""What is to be known of a frame, as kinds; sentences are made where a table is written."""

from collections.abc import Mapping
from enum import IntFlag
from types import MappingProxyType


class Flag(IntFlag):
    """Kinds of what is to be known of a frame, in the order of their sentences."""

    NO_TOUCH = 1
    OUTSIDE = 2  # the touch, or the signal's size, lies outside what was trained
    MISFIT = 4  # no touch explains the signal
    OTHER_PUNCH = 8
    GAIN = 16  # a channel's gain explains what no touch does
    OTHER_SIGN = 32  # where nearly all trained touches lower the readings, or nearly all raise them
    SEVERAL = 64
    TOO_FEW = 128  # of recorded presses, as all that follow but DRIFTED
    NOTHING_FOLLOWS = 256
    OLD = 512
    TOO_OLD = 1024
    OTHER_PATTERN = 2048
    WEAK = 4096
    STRONG = 8192
    OTHER_SESSION = 16384
    DRIFTED = 32768  # of a frame that is followed


WORDS = {
    Flag.NO_TOUCH: "no touch", Flag.OUTSIDE: "outside the training range", Flag.MISFIT: "unlike the trained touches",
    Flag.OTHER_PUNCH: "the diameter may lie outside the trained ones", Flag.GAIN: "as if a channel's gain had drifted",
    Flag.OTHER_SIGN: "signal of the other sign than a touch's", Flag.SEVERAL: "several answers for F",
    Flag.TOO_FEW: "more than half of the readings are dead",
    Flag.NOTHING_FOLLOWS: "the frame that follows, which holds some readings of this one, is not there",
    Flag.OLD: "the untouched frame is older than any in training, and the intervals are wider for it",
    Flag.TOO_OLD: "the untouched frame is older than any in training, and so much that the intervals may not hold",
    Flag.OTHER_PATTERN: "a pattern unlike those of the training presses", Flag.WEAK: "weaker than any training press",
    Flag.STRONG: "stronger than the training presses: what it says of depth or force may be too little",
    Flag.OTHER_SESSION: "the untouched frame is unlike those of training, as in another session: the intervals may not "
    "hold",
    Flag.DRIFTED: "off the untouched frame by more than is known of its drift, and unlike a touch: taken for drift"}


def in_words(kinds: int, detailed: Mapping[Flag, str] = MappingProxyType({})) -> str:
    """The sentences of some kinds, those that are detailed by what is more exact of this frame."""
    return "; ".join(detailed.get(one, WORDS[one]) for one in Flag if kinds & one)
