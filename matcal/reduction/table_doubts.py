"""What makes a table of strain and stress other than one loading that begins at contact."""

import numpy as np

from touchcal.arrays import Array

# share of the largest strain to which unloading falls; strain at which a curve's early stress is read, share of it that
# shows contact, and strain before which a specimen should be touched
_UNLOADED, _EARLY, _TOUCHED, _GAP = 0.7, 0.1, 0.1, 0.03


def loading_doubts(label: str, strain: Array, stress: Array) -> list[str]:
    """What is said of unloading, and of strain before the stress begins, in a table (n,) of both."""
    out, side = [], np.sign(strain[int(np.argmax(np.abs(strain)))])
    size = side * strain
    peak = int(np.argmax(size))
    rising, falling = size[:peak + 1], size[peak:]
    gradual = -np.diff(size).min() < (1 - _UNLOADED) * size[peak]  # else another loading follows
    if max(rising.min(), falling.min()) < _UNLOADED * size[peak] and gradual:
        out.append(f"The strain turns back in {label} after its largest: loading and unloading are fitted as one "
                   "curve. Keep the rows of one loading, or give displacement and force, of which the last loading is "
                   "taken.")
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
