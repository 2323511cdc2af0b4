"""Scores of a reader on presses that it did not see: some at random, and the last in time."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from surrogate.recordings import touch_reader
from surrogate.recordings.presses import Presses, taken
from touchcal.arrays import Array, Index

TESTED = 5  # every so many presses one is tested
SPLITS = ("random", "time")


@dataclass(frozen=True)
class ReaderScore:
    """One split; distances are means over tested presses in mm."""

    split: str  # one of SPLITS
    trained: int  # presses
    tested: int  # presses
    distance_mm: float
    ridge_mm: float  # kernel ridge regression, trained on the same presses
    centre_mm: float  # always the mean place of the training
    coverage: tuple[float, float]  # part of the tested x and y that the 90 % intervals hold
    width_mm: tuple[float, float]  # mean half width of these intervals


def split_rows(rows: int, split: str, seed: int) -> tuple[Index, Index]:
    """Rows that train and rows that test, a fifth of them, each in time order."""
    tested = rows // TESTED
    order = np.arange(rows) if split == "time" else np.random.default_rng(seed).permutation(rows)
    return np.sort(order[:rows - tested]), np.sort(order[rows - tested:])


def score(presses: Presses, place: Array, split: str, seed: int = 0) -> ReaderScore:
    """Train on four fifths of presses with places (n, 2), mm, and read the rest; errors as touch_reader.fit."""
    train, test = split_rows(len(place), split, seed)
    return scored(presses, place, train, test, split, seed)


def scored(presses: Presses, place: Array, train: Index, test: Index, split: str, seed: int) -> ReaderScore:
    """The score of a reader trained on some rows on others."""
    reader = touch_reader.fit(taken(presses, train), place[train], seed)
    found = touch_reader.read(reader, taken(presses, test))
    ridge = reader.ridge.read(touch_reader.prepared(reader, taken(presses, test)))
    miss = np.abs(found.value - place[test])
    return ReaderScore(split, len(train), len(test), _distance(found.value, place[test]), _distance(ridge, place[test]),
                       _distance(place[train].mean(axis=0), place[test]),
                       _pair((miss <= found.half_width).mean(axis=0)), _pair(found.half_width.mean(axis=0)))


def _distance(value: Array, place: Array) -> float:
    return float(np.linalg.norm(value - place, axis=-1).mean())


def _pair(values: Any) -> tuple[float, float]:
    first, second = values
    return float(first), float(second)
