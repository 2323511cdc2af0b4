"""Which code made the rows of a folder: other code does not add to them unasked, and the manifest tells whose they are.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.sweeps.dataset import parquet
from touchcal.cache import key_of

# Key of the manifest: code, its versions and its scenes ([first, last] of neighbours), of all rows but those of `code`.
EARLIER = "earlier_code"


def check_columns(folder: Path, columns: Sequence[str]) -> None:
    """ValueError where the rows of a folder have other columns than those that would be added to them."""
    for path in parquet.parts(folder)[:1]:
        there = parquet.columns_of(path)
        if there != list(columns):
            odd = sorted(set(there) ^ set(columns))
            raise ValueError(f"{folder} was made by other code, whose rows have other columns"
                             f"{f' ({odd[0]})' if odd else ''}. It can be read, not continued; choose another folder.")


def by_this_code(folder: Path, old: Mapping[str, Any], new: Mapping[str, Any], there: NDArray[np.bool_],
                 other_code: bool) -> dict[str, Any]:
    """The manifest `old` for rows that are added by the code of `new`, where those of the scenes `there` stand.

    ValueError where their code or libraries are others, unless other_code: their scenes are then kept in it.
    """
    if old["code"] == new["code"]:
        return dict(old)
    if there.any() and not other_code:
        raise ValueError(f"{folder} was made by other code or libraries ({_stated(old)}) than these ({_stated(new)}), "
                         "whose rows may differ. Choose another folder, or continue with --other-code: the folder then "
                         "tells which scenes are whose.")
    earlier, left = [], there.copy()
    for one in old.get(EARLIER, []):
        own = np.zeros_like(there)
        for first, last in one["scenes"]:
            own[first:last + 1] = True
        earlier.append(one | {"scenes": _runs(own & there)})
        left &= ~own
    earlier.append({"code": old["code"], "versions": old["versions"], "scenes": _runs(left)})
    return {**old, "code": new["code"], "versions": new["versions"], EARLIER: [one for one in earlier if one["scenes"]]}


def _stated(manifest: Mapping[str, Any]) -> str:
    return ", ".join([*(f"{name} {value}" for name, value in manifest["versions"].items()), manifest["code"][:12]])


def _runs(scenes: NDArray[np.bool_]) -> list[list[int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], scenes, [False]])))
    return [[int(first), int(stop) - 1] for first, stop in edges.reshape(-1, 2)]


def in_words(manifest: Mapping[str, Any]) -> str:
    """How many rows are of other code; empty where none is."""
    count = sum(last - first + 1 for one in manifest.get(EARLIER, []) for first, last in one["scenes"])
    return f"; {count} rows are of other code, as {parquet.MANIFEST} tells" if count else ""


def other_code(manifest: Mapping[str, Any]) -> str:
    """That rows of a sweep were solved by other code or libraries than are here, in words; empty where its manifest
    tells no code, or none but this."""
    codes = {manifest.get("code"), *(one["code"] for one in manifest.get(EARLIER, []))} - {None}
    return "other code or libraries than are here solved its rows" if codes - {key_of({})} else ""
