"""A model of several touches at once learnt from a recording and the places that its touches press."""

import time
from dataclasses import replace

import numpy as np

from eitsim.sensors.recording import Recording
from eitsim.sensors.touch_sets import TouchSets
from surrogate.data.dead_readings import teaching_nothing, too_many
from surrogate.model.recorded.lost_channels import silent_words, stuck_in, without_stuck
from surrogate.model.recorded.set_model import SetModel, SetScore, labelled_rows, set_score
from surrogate.recordings.presses import Presses, presses_of, taken
from surrogate.recordings.several import set_reader
from surrogate.recordings.several.press_means import press_numbers
from surrogate.recordings.several.superposition import pairs_together
from touchcal.arrays import Array, Index, Mask

FEWEST = 2  # presses of each place
ALONE = ("No labelled touch presses two places: superposition is assumed, and probabilities of several touches are "
         "untested.")


def learn_sets(recording: Recording, sets: TouchSets) -> SetModel:
    """Learn the pattern of each place, and how pairs of them interact, from presses of one place or several; test on
    held-out blocks in time and, trained on the others, on the presses of most places at once. Channels that stick at a
    value, or are dead in most presses, are left out, and so are frames that lack others.

    ValueError where there are more than MOST_PLACES places, a place is pressed fewer than FEWEST times, or two places
    are never pressed without each other.

    >>> sets = surrogate.read_touch_sets("places.csv")
    >>> model = surrogate.learn_sets(eitsim.read_recording("two_places.csv"), sets)
    >>> model.predict(eitsim.read_recording("two_places.csv"))["places"].tolist()[:3]
    ['A', 'B', 'A; B']
    """
    read = without_stuck(recording)
    every, stuck = presses_of(read), stuck_in(recording, read)
    rows, of = labelled_rows(every, sets)
    dead = np.isnan(every.signal[rows])
    whole = np.array([not too_many(one) for one in dead])
    silent = stuck | teaching_nothing(dead[whole], 0)
    sound = whole & ~dead[:, ~silent].any(axis=1)
    every = replace(every, signal=np.where(silent, np.nan, every.signal))
    presses = taken(every, rows[sound])
    press = press_numbers(presses)
    touch = of[sound][np.unique(press, return_index=True)[1]]
    down = sets.down[touch]
    left_out = [f"{np.sum(~sound)} labelled frames with dead readings are left out."] * bool((~sound).any())
    left_out += silent_words(silent, stuck, recording.columns)
    _check(sets.places, down)
    begun = time.process_time()
    amount, mean_force_N = down.astype(float), None
    if sets.force_N is not None:
        force_N = sets.force_N[touch]
        mean_force_N = force_N.sum(axis=0) / down.sum(axis=0)
        amount = force_N / mean_force_N
    reader, held = set_reader.fit(presses, amount, press)
    fit_s = time.process_time() - begun
    scores = (set_score("held-out blocks in time", len(down), held, down), *_of_most(presses, amount, press))
    if not len(pairs_together(down)):
        left_out.append(ALONE)
    return SetModel(reader, sets.places, sets.at_mm, recording.kind, len(down), len(press), every.clocked,
                    fit_s, scores, mean_force_N, tuple(left_out))


def _of_most(presses: Presses, amount: Array, press: Index) -> tuple[SetScore, ...]:
    """The score on presses of most places at once of a reader of the others; none where these lack a place."""
    down = amount > 0
    count = down.sum(axis=1)
    most = count == count.max()
    try:
        _check(tuple(map(str, range(down.shape[1]))), down[~most])
    except ValueError:
        return ()
    fewer, tested = np.flatnonzero(~most[press]), np.flatnonzero(most[press])
    reader, _ = set_reader.fit(taken(presses, fewer), amount[~most], press[fewer])
    found = set_reader.read(reader, taken(presses, tested), press[tested])
    return (set_score(f"{count.max()} at once, trained on fewer", int(np.sum(~most)), found, down[most]),)


def _check(places: tuple[str, ...], down: Mask) -> None:
    """ValueError where presses do not say what each place does."""
    if len(places) > set_reader.MOST_PLACES:
        raise ValueError(f"{len(places)} places are labelled, and sets of at most {set_reader.MOST_PLACES} are read. "
                         "Label touches at random places with one row a touch; where a touch stands in two rows by "
                         "mistake, leave one out.")
    often = down.sum(axis=0)
    if (often < FEWEST).any():
        rare = int(often.argmin())
        raise ValueError(f"the place {places[rare]} is pressed {often[rare]} times; press each place {FEWEST} times or "
                         "more.")
    if np.linalg.matrix_rank(down.astype(float)) < len(places):
        raise ValueError(f"the places {', '.join(places)} are pressed in too few different sets to say what each adds. "
                         "Press each of them alone as well.")
