"""Compression or tension: the words that tell, in the languages that machines and people use, and the curve's shape."""

import re
from collections.abc import Sequence

import numpy as np

from matcal.readers.recording import Recording
from touchcal.arrays import Array

DIRECTIONS = ("compression", "tension")
SIGNS = {"compression": -1.0, "tension": 1.0}
_WORDS = {"compression": r"\bcomp\b|\bkompr|\bcompr|(?<!aus)druck(?!er|sensor)|stauch|schiacc"
                         r"|[eé]crasement|puristus|ściskan|sciskan|stlačen|stlacen|сжати|\buc\b|压缩|壓縮|圧縮|압축",
          "tension": r"\btension|\btensile|\bstretch(?!er)|\bzug|zugvers|\btraction|\btracci|\btrazione|rozciąg|rozciag"
                     r"|растяж|\but\b|拉伸|引張|인장"}


def named_direction(texts: Sequence[str]) -> str | None:
    """The one direction that words name; None where they name none or both."""
    text = re.sub(r"[_\-.\d]+", " ", " ".join(texts).lower())
    named = [direction for direction, words in _WORDS.items() if re.search(words, text)]
    return named[0] if len(named) == 1 else None


def words_about(recording: Recording) -> list[str]:
    """What a recording says of its test: the titles above its table and the file's name."""
    return [*(value for key, value in recording.titles if key != "File Path"), recording.paths[0].stem]


def densifies(strain: Array, stress: Array) -> bool:
    """Whether the slope of a curve, of strains (n,) of one sign, first falls and then rises to more than twice its
    least, as that of foam does in compression."""
    order = np.argsort(np.abs(strain))
    parts = [part for part in np.array_split(order, 8) if part.size > 1]
    slopes = [float(np.polyfit(strain[part], stress[part], 1)[0]) for part in parts if np.ptp(strain[part]) > 0]
    if len(slopes) < 6:
        return False
    least = int(np.argmin(slopes))
    return 0 < least < len(slopes) - 1 and slopes[-1] > 2 * slopes[least] > 0 and slopes[0] > 1.2 * slopes[least]
