"""The order that EIDORS's stimulation structures state: which pair drives and which pairs are read, one by one."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.io.matlab import mat_struct
from scipy.sparse import issparse

from touchcal.arrays import Array, Index

_FIELDS = ("stim_pattern", "meas_pattern")
_DEEPEST = 6  # structures within structures that are looked into


def stated_pairs(variables: Mapping[str, Any]) -> Index | None:
    """(readings, 4) source, sink, plus and minus by the only list of stimulations among the variables of a MATLAB file;
    None without one, or where it is of other currents or measurements than pairs."""
    lists = [found for value in variables.values() for found in _lists(value, _DEEPEST)]
    parts = [] if len(lists) != 1 else [_pairs(one) for one in lists[0]]
    if not parts or any(part is None for part in parts):
        return None
    return np.vstack([part for part in parts if part is not None])


def _lists(value: Any, deep: int) -> Iterator[list[Any]]:
    """Lists of stimulations in a value."""
    array = np.atleast_1d(np.asarray(value, dtype=object)).ravel() if isinstance(value, np.ndarray | mat_struct) else ()
    structures = [one for one in array if isinstance(one, mat_struct)]
    if structures and all(all(hasattr(one, name) for name in _FIELDS) for one in structures):
        yield structures
    elif deep:
        for one in structures:
            for name in vars(one):
                yield from _lists(getattr(one, name), deep - 1)


def _pairs(stimulation: Any) -> Index | None:
    """(readings, 4) of one stimulation; None where it is not of pairs."""
    current, weights = (_dense(getattr(stimulation, name)) for name in _FIELDS)
    if current is None or weights is None:
        return None
    ends, read = _ends(current.reshape(1, -1)), _ends(np.atleast_2d(weights))
    if ends is None or read is None:
        return None
    return np.hstack([np.repeat(ends, len(read), axis=0), read])


def _dense(value: Any) -> Array | None:
    array = np.asarray(value.toarray() if issparse(value) else value)
    return array.astype(float) if array.dtype.kind in "buif" else None


def _ends(rows: Array) -> Index | None:
    """(n, 2) electrodes of the positive and of the negative entry of each row; None where a row has others."""
    size = np.abs(rows).max(axis=1, keepdims=True)
    two = ((np.abs(rows) > 1e-9 * size).sum(axis=1) == 2).all() and (np.abs(rows.sum(axis=1)) < 1e-9 * size[:, 0]).all()
    return np.stack([rows.argmax(axis=1), rows.argmin(axis=1)], axis=1) if two else None
