"""Scores of a reader on presses that it did not see: some at random, and the last in time."""

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from eitsim.sensors.labels import PLACE, Labels, labels_of, unit_of
from surrogate.recordings import press_reader
from surrogate.recordings.press_frames import frames_of, press_of_frames
from surrogate.recordings.press_reader import Reader
from surrogate.recordings.presses import Presses, taken, until
from surrogate.recordings.worth import distance
from surrogate.statistics.conformal import radius
from surrogate.statistics.coverage_check import CoverageCheck, coverage_check, in_words
from touchcal.arrays import Array, Index

Fit = Callable[[Presses, Labels, int], Reader]  # teaches a reader by a seed
TESTED = 5  # every so many presses one is tested
SPLITS = ("random", "time")


@dataclass(frozen=True)
class ReaderScore:
    """One output on one split; errors are means over tested frames in the unit of the output."""

    split: str  # one of SPLITS
    output: str  # "place", whose errors are distances, or the name of a label
    unit: str
    trained: int  # presses
    tested: int  # presses
    trained_frames: int  # of these presses
    tested_frames: int
    error: float
    ridge_error: float  # of kernel ridge regression, trained on the same presses
    mean_error: float  # of the mean of the training
    coverage: tuple[float, ...]  # part of the tested frames that the 90 % intervals hold: of x and y, or of the label
    half_width: tuple[float, ...]  # mean half width of these intervals
    in_ellipse: float | None  # part of the tested frames that the 90 % ellipses hold; None of a label


@dataclass(frozen=True, eq=False)
class Tested:
    """What was read of frames of presses that did not train: one output on one split."""

    score: ReaderScore
    target: Array  # (n, k) places or labels of the tested frames, in the unit of the output
    value: Array  # (n, k)
    half_width: Array  # (n, k) of the 90 % intervals


def found_wanting(scores: Iterable[ReaderScore]) -> dict[str, list[dict[str, Any]]]:
    """As JSON, which intervals hold less than they promise, and which outputs are read no better than by their mean."""
    scores = tuple(scores)
    return {"coverage_below": [{"split": one.split, "output": name} | asdict(check)
                               for one, name, check in _checked(scores) if check.too_low],
            "worse_than_mean": [{"split": one.split, "output": one.output, "error": one.error,
                                 "mean_error": one.mean_error} for one in _worse(scores)]}


def wanting_words(scores: Iterable[ReaderScore]) -> list[str]:
    """The same in words, a sentence each."""
    scores = tuple(scores)
    return [*(in_words(check, f"{name}, split {one.split}") for one, name, check in _checked(scores) if check.too_low),
            *(f"{one.output}, split {one.split}: presses are read to {one.error:.3g} {one.unit}, no better than by "
              f"their mean, {one.mean_error:.3g} {one.unit}: do not use this output." for one in _worse(scores))]


def _checked(scores: tuple[ReaderScore, ...]) -> list[tuple[ReaderScore, str, CoverageCheck]]:
    """Each score with the names and checks of its intervals."""
    held = [(one, name, part) for one in scores
            for name, part in zip(PLACE if one.output == "place" else (one.output,), one.coverage, strict=True)]
    return [(one, name, coverage_check(part, one.tested, checks=len(held))) for one, name, part in held]


def _worse(scores: tuple[ReaderScore, ...]) -> list[ReaderScore]:
    return [one for one in scores if one.error >= one.mean_error]


@dataclass(frozen=True, eq=False)
class Rows:
    """Labelled frames, and those that train and that test."""

    press: Index  # (all rows,) press of each
    train: Index
    test: Index


def split_rows(rows: int, split: str, seed: int) -> tuple[Index, Index]:
    """Presses that train and presses that test, a fifth of them, each in time order."""
    tested = rows // TESTED
    order = np.arange(rows) if split == "time" else np.random.default_rng(seed).permutation(rows)
    return np.sort(order[:rows - tested]), np.sort(order[rows - tested:])


def read_split(presses: Presses, labels: Labels, split: str, seed: int = 0,
               fit: Fit = press_reader.fit) -> tuple[Tested, ...]:
    """Train on four fifths of labelled presses and read all frames of the rest, for each output that is read; errors as
    press_reader.fit."""
    press = press_of_frames(presses, labels)
    train, test = (frames_of(press, some) for some in split_rows(int(press.max()) + 1, split, seed))
    return read_rows(presses, labels, train, test, split, seed, fit)


def read_rows(presses: Presses, labels: Labels, train: Index, test: Index, split: str, seed: int,
              fit: Fit = press_reader.fit) -> tuple[Tested, ...]:
    """What a reader trained on some rows, and on the untouched frames until the last of them, reads of others."""
    reader = fit(until(taken(presses, train), float(presses.time[train].max())), labels_of(labels, train), seed)
    tested = taken(presses, test)
    found = press_reader.read(reader, tested)
    known = dict(zip(labels.names, labels.values.T, strict=True))
    rows = Rows(press_of_frames(presses, labels), train, test)
    out = []
    if found.place:
        target = np.stack([known[name] for name in PLACE], axis=1)
        one = _tested(split, "place", "mm", target, rows, found.place.value, found.place.bounds.half_width,
                      reader.yardstick("place", tested))
        inside = radius(found.place.value - target[test], found.place.bounds) <= found.place.bounds.ellipse
        out.append(replace(one, score=replace(one.score, in_ellipse=float(inside.mean()))))
    for one in found.scalars:
        out.append(_tested(split, one.name, unit_of(one.name), known[one.name][:, None], rows, one.value[:, None],
                           one.half_width[:, None], reader.yardstick(one.name, tested)))
    return tuple(out)


def _tested(split: str, output: str, unit: str, target: Array, rows: Rows, value: Array, half_width: Array,
            ridge: Array) -> Tested:
    """The score of values (n, k) and of those of kernel ridge regression; target (all rows, k)."""
    there = target[rows.test]
    held = np.abs(value - there) <= half_width
    counts = (len(np.unique(rows.press[rows.train])), len(np.unique(rows.press[rows.test])))
    score = ReaderScore(split, output, unit, *counts, len(rows.train), len(rows.test), distance(value, there),
                        distance(ridge, there), distance(target[rows.train].mean(axis=0), there),
                        tuple(held.mean(axis=0).tolist()), tuple(half_width.mean(axis=0).tolist()), None)
    return Tested(score, there, value, half_width)
