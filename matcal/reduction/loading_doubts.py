"""What makes a record other than one steady loading that begins at contact: unloading, gaps, collapse, holds."""

import numpy as np

from matcal.reduction.hold_segments import find_holds
from matcal.statistics.block_means import block_means
from touchcal.arrays import Array
from touchcal.number_words import counted, percent

# share of the largest strain to which unloading falls; strain at which a curve's early stress is read, share of it that
# shows contact, and strain before which a specimen should be touched
_UNLOADED, _EARLY, _TOUCHED, _GAP = 0.7, 0.1, 0.1, 0.03
# fewest rows that show a collapse or a hold, blocks that noise is averaged in, share of the largest load to which it
# falls, share of the travel that is left then, and share of the largest load up to which it is one loading
_SHOWN, _BLOCKS, _COLLAPSED, _ON, _TOP = 12, 200, 0.15, 0.02, 0.95


def loading_doubts(label: str, strain: Array, stress: Array) -> list[str]:
    """What is said of unloading, and of strain before the stress begins, in a table (n,) of both."""
    out, side = [], np.sign(strain[int(np.argmax(np.abs(strain)))])
    size = side * strain
    peak = int(np.argmax(size))
    rising, falling = size[:peak + 1], size[peak:]
    gradual = -np.diff(size).min() < (1 - _UNLOADED) * size[peak]  # else another loading follows
    if max(rising.min(), falling.min()) < _UNLOADED * size[peak] and gradual:
        out.append(f"The strain turns back in {label} after its largest: loading and unloading are fitted as one "
                   "curve. Give --unloading, which fits what unloading softens, or keep the rows of one loading.")
    order = np.argsort(rising, kind="stable")
    early, load = rising[order], side * stress[:peak + 1][order]
    if early[0] < _GAP and early[-1] > 1.5 * _EARLY:
        within = early <= _EARLY
        touched = load[within] > _TOUCHED * float(np.interp(_EARLY, early, load))
        first = int(np.argmax(touched))
        if touched.any() and first and (start := float(early[within][first - 1])) > _GAP:
            out.append(f"No load is carried in {label} up to a strain of {side * start:.3f}, and a table's strain is "
                       "taken as it stands. Count it from contact, or give displacement and force, in which contact "
                       "is found.")
    return out


def collapse(travel: Array, load: Array) -> int | None:
    """Index of the largest load of a loading, (n,) of travel that grows and of load, where the load falls to nothing
    afterwards while the travel still grows: the specimen broke, or the travel counts on as it is let go; else None."""
    if travel.size < _SHOWN:
        return None
    size = max(1, travel.size // _BLOCKS)
    edges = np.append(np.arange(0, travel.size, size), travel.size)
    mean = block_means(load, edges)
    block = int(np.argmax(mean))
    after = mean[block + 1:]
    if mean[block] <= 0 or after.size < 2 or after[-max(1, after.size // 4):].max() > _COLLAPSED * mean[block]:
        return None
    last = int(np.flatnonzero(load > 0.5 * mean[block])[-1])
    top = int(np.flatnonzero(load[:last + 1] >= _TOP * load[:last + 1].max())[-1])
    return top if travel[-1] - travel[top] > _ON * abs(travel[-1]) else None


def collapse_sentence(label: str, at: str, end: str) -> str:
    """What is said where `collapse` found that a loading ends at the travel or strain `at`, the record at `end`."""
    return (f"The load of {label} falls from its largest, at {at}, to nothing while the record goes on to {end}: the "
            "specimen broke or came free, or the displacement counts on as the frame returns. The loading up to the "
            "largest load is used.")


def hold_doubts(label: str, time: Array | None, strain: Array, stress: Array) -> list[str]:
    """What is said of holds on the way of a loading (n,) from rest to its largest strain."""
    if time is None or time.size < _SHOWN or np.any(np.diff(time) < 0):
        return []
    size = np.abs(strain)
    held = [(a, b) for a, b in find_holds(time, size) if b < size.size - 1 and time[b - 1] > time[a]]
    if not held:
        return []
    length = float(np.median([time[b - 1] - time[a] for a, b in held]))
    lost = max(1 - abs(float(stress[b - 1])) / max(float(np.abs(stress[a:b]).max()), 1e-300) for a, b in held)
    return [f"{label} is no steady loading: its strain is held {counted(len(held), 'time')} on the way, for some "
            f"{length:.3g} s, in which the stress falls by up to {percent(max(lost, 0.0), 2)}, and runs at some "
            f"{ramp_speed(time, size):.2g}/s between. The holds are in the curve. As relaxation test the file says how "
            "the foam relaxes in them."]


def ramp_speed(time: Array, travel: Array) -> float:
    """Speed, unit of the travel a second, that half of the travel (n,) was moved slower than."""
    steps = slice(None, None, max(1, min(3, time.size // 30)))
    moved, spent = np.abs(np.diff(travel[steps])), np.diff(time[steps])
    moved, spent = moved[spent > 0], spent[spent > 0]
    order = np.argsort(moved / spent)
    half = int(np.searchsorted(np.cumsum(moved[order]), 0.5 * moved.sum()))
    return float((moved / spent)[order][half])
