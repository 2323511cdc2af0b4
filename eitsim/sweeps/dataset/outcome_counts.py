"""Outcomes and errors of rows, counted without keeping the rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

_NAMED = ["scene", "outcome", "message"]
COLUMNS = [*_NAMED, "signal_error", "cpu_s"]
_BIN = 0.01  # Errors fall into bins of this width in their logarithm.


@dataclass(frozen=True)
class OutcomeCounts:
    """What became of some rows."""

    outcomes: Mapping[str, int] = field(default_factory=dict)  # outcome -> number of rows
    # outcome other than "ok" -> its first scene and the message there
    first: Mapping[str, tuple[int, str]] = field(default_factory=dict)
    errors: Mapping[int, int] = field(default_factory=dict)  # round(log(signal_error) / _BIN) -> number of ok rows
    cpu_s: float = 0.0  # their CPU time, s

    @property
    def rows(self) -> int:
        return sum(self.outcomes.values())

    def error_below(self, share: float) -> float | None:
        """What the signal errors of this share of the ok rows lie below, to half a per cent of it; None without such
        rows."""
        bins = sorted(self.errors)
        counts = np.cumsum([self.errors[b] for b in bins])
        return float(np.exp(_BIN * bins[int(np.searchsorted(counts, share * counts[-1]))])) if bins else None

    def __add__(self, other: OutcomeCounts) -> OutcomeCounts:
        first = {name: min(part[name] for part in (self.first, other.first) if name in part)
                 for name in {*self.first, *other.first}}
        return OutcomeCounts(Counter(self.outcomes) + Counter(other.outcomes), first,
                             Counter(self.errors) + Counter(other.errors), self.cpu_s + other.cpu_s)


def count_outcomes(table: pd.DataFrame) -> OutcomeCounts:
    """Count a table that has COLUMNS, sorted by scene."""
    ok = (table["outcome"] == "ok").to_numpy()
    first: dict[str, tuple[int, str]] = {}
    for scene, outcome, message in zip(*(table.loc[~ok, name].tolist() for name in _NAMED), strict=True):
        first.setdefault(outcome, (scene, message))
    errors = table.loc[ok, "signal_error"].to_numpy(dtype=float)
    bins = np.rint(np.log(errors[errors > 0]) / _BIN).astype(int)
    return OutcomeCounts(Counter(table["outcome"].tolist()), first, Counter(bins.tolist()),
                         float(np.nansum(table["cpu_s"].to_numpy(dtype=float))))
