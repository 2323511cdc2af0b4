"""A model of presses learnt from a recording and its labels, scored on two splits."""

import time
from dataclasses import replace
from functools import partial

import numpy as np

from eitsim.sensors.labels import Labels, labels_of, unit_of
from eitsim.sensors.recording import Recording
from surrogate.data.dead_readings import teaching_nothing, too_many
from surrogate.model.recorded import plain_reader
from surrogate.model.recorded.continued import continued
from surrogate.model.recorded.lost_channels import lost_words, stuck_in, taught_without, without_stuck
from surrogate.model.recorded.plain_reader import PlainReader
from surrogate.model.recorded.press_model import BY_FAMILIES, PressModel
from surrogate.model.recorded.reader_scores import SPLITS, TESTED, Tested, read_split
from surrogate.recordings import press_reader, scalar_reader, touch_reader
from surrogate.recordings.physics.expectation import Expectation
from surrogate.recordings.press_frames import counted, press_of_frames, with_presses
from surrogate.recordings.press_reader import PressReader, Reader
from surrogate.recordings.presses import Presses, labelled, presses_of, silenced, taken
from surrogate.recordings.signals import FEWEST
from touchcal.arrays import Array
from touchcal.parallel.pool import Failed, answers
from touchcal.parallel.processes import processes

EXPECTED = ("the model of the sensor", "the symmetry of its ring")  # what physics expects, in the order of its weights


def learn(recording: Recording, labels: Labels, seed: int = 0, workers: int = 1,
          expectation: Expectation | None = None, method: str = BY_FAMILIES) -> PressModel:
    """Learn the labels of a recording's presses by families of readers whose weights make the held-out error least, and
    test readers of four fifths of the presses on the rest, at random and the last in time. A channel that is dead, or
    sticks at a value, is filled in from there; one that most presses lack teaches nothing, in no frame.

    recording: frames in time order, (n, m) readings of one kind; labels: of ten presses or more; workers: processes;
    expectation: what a model of the sensor expects, used where it explains held-out presses better; method: "families",
    or one of `METHODS` in their place.
    ValueError where the presses are too few, or dead channels too many; NothingToRead where no label is read better
    than by its mean.

    >>> recording, labels = eitsim.read_recording("frames.csv"), surrogate.read_labels("touches.csv")
    >>> model = surrogate.learn(recording, labels, method="ridge")
    >>> model.presses, len(model.predict(recording))
    (40, 40)
    """
    sound = without_stuck(recording)
    presses, known, left_out = _readable(*labelled(presses_of(sound), labels, str(recording.source)))
    silent = teaching_nothing(np.isnan(presses.signal), FEWEST)
    presses, known = silenced(presses, silent), with_presses(presses, known)
    count, frames = int(press_of_frames(presses, known).max()) + 1, len(known.touch)
    splits = SPLITS if count - count // TESTED >= FEWEST else ()
    if not splits:
        left_out.append(f"{counted(count, frames)} are too few to test on as well: there are no scores. Label "
                        "more of them.")
    found = {}
    with processes(min(workers, 1 + len(splits))) as pool:
        for item, answer in answers(pool, partial(_answer, presses, known, seed, expectation, method), ("", *splits)):
            if isinstance(answer, Failed):
                raise answer.error
            found[item] = answer
    reader, fit_s = found.pop("")
    left_out += taught_without(reader, presses, silent, stuck_in(recording, sound))
    left_out += [f"split {split}, no scores: {found[split]}" for split in splits if isinstance(found[split], str)]
    tested = tuple(one for split in splits if not isinstance(found[split], str) for one in found[split])
    return PressModel(reader, recording.kind, count, frames, seed, tested, fit_s, tuple(left_out),
                      method=method)


def learn_session(model: PressModel, recording: Recording, labels: Labels) -> PressModel:
    """A model of another session of the same skin, from five or more labelled presses of it: gains of readings, where
    the skin lies, what is added to patterns and how they scatter are learnt anew, the map from the first session stays.

    The scores of the first session are left out; what the presses say, each read by what the others teach, stands in
    `left_out`. ValueError where the model is no one of families that reads places, or the presses are too few.

    >>> recording, labels = eitsim.read_recording("frames.csv"), surrogate.read_labels("touches.csv")
    >>> surrogate.learn_session(surrogate.load("presses"), recording, labels).presses
    40
    """
    if not isinstance(model.reader, PressReader):
        raise ValueError(f"a model of the method {model.method} is not continued in another session. Learn the first "
                         "session by the method families.")
    begun = time.process_time()
    presses, known, left_out = _readable(*labelled(model.presses_of(recording), labels, str(recording.source)))
    _, first = np.unique(press_of_frames(presses, known), return_index=True)
    presses, known = taken(presses, first), labels_of(known, first)
    found = continued(model.reader, presses, known)
    left_out += filter(None, [lost_words(model.reader, presses)])
    motion = found.reader.motion
    lies = ("the skin lies where it did" if motion is None else
            f"the skin is turned by {np.degrees(motion.turn):.0f} +- {np.degrees(motion.turn_sd):.0f} degrees, and its "
            f"middle is shifted by ({motion.shift[0]:.1f}, {motion.shift[1]:.1f}) +- {motion.shift_sd:.1f} mm")
    said = (f"another session, by {len(first)} labelled presses of it: {lies}; each read by what the others teach, "
            f"they are read to {found.after_mm:.3g} mm, to {found.before_mm:.3g} mm by the model of the first session; "
            f"intervals are {found.widening:.2f} times as wide.")
    return replace(model, reader=found.reader, tested=(), left_out=(*model.left_out, *left_out, said),
                   fit_s=time.process_time() - begun)


def _readable(presses: Presses, labels: Labels) -> tuple[Presses, Labels, list[str]]:
    """Presses too many of whose readings are not dead, their labels, and how many others there are, in words."""
    dead = [bool(too_many(one)) for one in np.isnan(presses.signal)]
    if not any(dead):
        return presses, labels, []
    rows = np.flatnonzero(~np.array(dead))
    return taken(presses, rows), labels_of(labels, rows), [
        f"{sum(dead)} labelled frames, more than half of whose readings are dead, are left out."]


def _answer(presses: Presses, labels: Labels, seed: int, expectation: Expectation | None, method: str,
            split: str) -> tuple[Tested, ...] | str | tuple[Reader, float]:
    """What is read on a split, or why its four fifths teach nothing; for no split the reader of all and its time."""
    begun = time.process_time()
    fit = (partial(press_reader.fit, expectation=expectation) if method == BY_FAMILIES else
           partial(plain_reader.fit, method))
    if not split:
        return fit(presses, labels, seed), time.process_time() - begun
    try:
        return read_split(presses, labels, split, seed, fit)
    except ValueError as refusal:
        return str(refusal)


def choice(reader: PressReader | PlainReader) -> tuple[str, ...]:
    """In words, for each output, what reads it, which families with which weights, how each did on held-out blocks in
    time; and what is left out."""
    if isinstance(reader, PlainReader):
        return reader.choice()
    said = []
    if reader.place:
        taken_out = (f"; {reader.place.projected} directions of drift are projected out" if reader.place.projected
                     else "")
        views = (("direction", reader.place.direction), ("readings", reader.place.compressed))
        expected = "".join(_expected(name, one.weights[1:]) for name, one in views)
        said.append("place: " + _families(touch_reader.FAMILIES, reader.place.weights, reader.place.held_out,
                                          "distance", "mm") + taken_out + expected)
    said += [f"{one.name}: " + _families(scalar_reader.FAMILIES, one.weights, one.held_out, "error", unit_of(one.name))
             for one in reader.scalars]
    return (*said, *reader.left_out)


def _expected(view: str, weights: Array) -> str:
    """What templates of a view go on from, by the weights of what physics expects; empty where nothing is expected."""
    if not weights.any():
        return f"; no physics helps templates of {view}" if len(weights) else ""
    used = (f"{name} by {weight:.2f}" for name, weight in zip(EXPECTED, weights, strict=False))
    return f"; templates of {view} go on from {' and '.join(used)}"


def _families(names: tuple[str, ...], weights: Array, held_out: Array, measure: str, unit: str) -> str:
    used = [f"{names[i]} {weights[i]:.2f}" for i in np.argsort(-weights) if weights[i] > 0]
    tried = (*names[:len(weights)], "combined", "the mean")
    alone = [f"{name} {value:.3g}" for name, value in zip(tried, held_out, strict=True)]
    return (f"weights by mean square errors on held-out blocks in time, drawn to those that served other skins: "
            f"{', '.join(used)}. Mean {measure} there, {unit}: {', '.join(alone)}")
