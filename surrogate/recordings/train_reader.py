"""A reader of touches trained on a recording and its labels, scored on two splits."""

import time
from dataclasses import dataclass
from functools import partial

import numpy as np

from eitsim.sensors.labels import Labels
from eitsim.sensors.recording import Recording
from surrogate.recordings import touch_reader
from surrogate.recordings.presses import Presses, labelled, presses_of
from surrogate.recordings.reader_scores import SPLITS, TESTED, ReaderScore, score
from surrogate.recordings.touch_reader import FAMILIES, FEWEST, NothingToRead, TouchReader
from touchcal.arrays import Array
from touchcal.parallel.pool import Failed, answers
from touchcal.parallel.processes import processes


@dataclass(frozen=True, eq=False)
class TrainedReader:
    """A reader, and what is known of how well it reads."""

    reader: TouchReader
    kind: str  # of the readings, one of recording.KINDS
    presses: int  # that it was trained on
    seed: int
    scores: tuple[ReaderScore, ...]  # of readers trained on four fifths; none where these are too few
    fit_s: float  # CPU time of the reader, s


def train_reader(recording: Recording, labels: Labels, seed: int = 0, workers: int = 1) -> TrainedReader:
    """Learn places from the labelled presses of a recording, and score readers of four fifths of them on the rest.

    ValueError and touch_reader.NothingToRead as touch_reader.fit.
    """
    presses, place = labelled(presses_of(recording), labels, str(recording.source))
    splits = SPLITS if len(place) - len(place) // TESTED >= FEWEST else ()
    found = {}
    with processes(min(workers, 1 + len(splits))) as pool:
        for item, answer in answers(pool, partial(_answer, presses, place, seed), ("", *splits)):
            if isinstance(answer, Failed):
                raise answer.error
            found[item] = answer
    reader, fit_s = found[""]
    if isinstance(reader, NothingToRead):
        raise reader
    scores = tuple(found[split] for split in splits if found[split] is not None)
    return TrainedReader(reader, recording.kind, len(place), seed, scores, fit_s)


def _answer(presses: Presses, place: Array, seed: int,
            split: str) -> ReaderScore | tuple[TouchReader | NothingToRead, float] | None:
    """The score of a split, None where four fifths say nothing; for no split the reader of all and its time."""
    begun = time.process_time()
    try:
        if split:
            return score(presses, place, split, seed)
        return touch_reader.fit(presses, place, seed), time.process_time() - begun
    except NothingToRead as refusal:
        return None if split else (refusal, 0.0)


def choice(reader: TouchReader) -> str:
    """In words, which families read, with which weights, and how each did on held-out blocks in time."""
    order = np.argsort(-reader.weights)
    used = [f"{FAMILIES[i]} {reader.weights[i]:.2f}" for i in order if reader.weights[i] > 0]
    alone = [f"{name} {value:.3g}" for name, value in zip((*FAMILIES, "combined", "the mean place"), reader.held_out,
                                                          strict=True)]
    taken_out = f"; {reader.projected} directions of drift are projected out" if reader.projected else ""
    return (f"weights that make the held-out error least: {', '.join(used)}{taken_out}. Mean distance on held-out "
            f"blocks in time, mm: {', '.join(alone)}")
