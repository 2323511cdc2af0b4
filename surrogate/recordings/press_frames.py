"""Which frames show one press: they are never in training and test at once, and counts are of presses."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from eitsim.sensors.labels import PLACE, Labels
from surrogate.recordings.presses import Presses
from touchcal.arrays import Index, Mask

FEWEST_RUNS = 10  # runs of touched frames from which on each is taken for a press


def press_of_frames(presses: Presses, labels: Labels) -> Index:
    """(n,) number of the press that each labelled frame shows, from 0 in the order of their first frames.

    Frames show one press where they have one name, of `touch` or of the labels' `press`; where they follow each other
    and have one place; and, where labels have no place, where they follow each other without an untouched frame
    between, if the recording has FEWEST_RUNS such runs or more.
    """
    links = [_same(presses.name), _next(_one_place(labels, presses))]
    if labels.press is not None:
        links.append(_same(labels.press))
    return _numbered(len(presses.name), np.hstack(links))


def with_presses(presses: Presses, labels: Labels) -> Labels:
    """The labels with the press of each frame by its number, which some of the frames keep."""
    return replace(labels, press=press_of_frames(presses, labels).astype(np.str_))


def frames_of(press: Index, rows: Index) -> Index:
    """The frames of some presses (k,), in time order."""
    return np.flatnonzero(np.isin(press, rows))


def counted(presses: int, frames: int) -> str:
    """In words, how many presses, and how many frames where these are more."""
    return f"{presses} labelled presses" + f" of {frames} frames" * (frames > presses)


def _one_place(labels: Labels, presses: Presses) -> Mask:
    """(n - 1,) whether a frame shows what the frame before it shows."""
    if {*PLACE} <= {*labels.names}:
        place = labels.values[:, [labels.names.index(name) for name in PLACE]]
        return np.all(np.diff(place, axis=0) == 0, axis=1)
    together = np.diff(np.searchsorted(presses.rest_time, presses.time)) == 0
    return together & (np.sum(~together) + 1 >= FEWEST_RUNS)


def _same(name: NDArray[np.str_]) -> Index:
    """(2, k) pairs of a row and the next one of the same name."""
    order = np.argsort(name, kind="stable")
    equal = name[order][1:] == name[order][:-1]
    return np.stack([order[:-1][equal], order[1:][equal]])


def _next(linked: Mask) -> Index:
    first = np.flatnonzero(linked)
    return np.stack([first, first + 1])


def _numbered(count: int, pairs: Index) -> Index:
    graph = coo_array((np.ones(pairs.shape[1]), (pairs[0], pairs[1])), shape=(count, count))
    _, part = connected_components(graph, directed=False)
    _, first, inverse = np.unique(part, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse].astype(np.intp)
