"""How the mechanics of a row's touches were solved, as the kinds of their routes."""

import numpy as np
import pandas as pd

from eitsim.sweeps.dataset.parquet import METHODS
from touchcal.arrays import Mask

KIND = "mechanics_kind"  # Column of the kinds, each once; sets that were made earlier have none.
FAR = {"", "axisymmetric", "pair"}  # Kinds by which no edge counts, and what rows hold whose touches were not solved.
# What stands in mechanics_method of an earlier set where an edge was near a touch.
_NEAR_RIM = {"solved near the rim", "table near the rim"}


def near_edge(rows: pd.DataFrame) -> Mask:
    """(rows,) whether the mechanics of a touch were solved with an edge near it; of earlier rows by their codes."""
    words, kinds = (rows[name] if name in rows else pd.Series(None, rows.index, dtype=object)
                    for name in (METHODS[0], KIND))
    return np.array([not FAR.issuperset(kind.split(", ")) if isinstance(kind, str) else
                     not _NEAR_RIM.isdisjoint(str(word).split(", ")) for kind, word in zip(kinds, words, strict=True)],
                    dtype=bool)
