"""How the mechanics of a row's touches were solved, as the kinds of their routes."""

import numpy as np
import pandas as pd

from eitsim.sweeps.dataset.parquet import METHODS
from touchcal.arrays import Mask

KIND = "mechanics_kind"  # Column of the kinds, each once; sets that were made earlier have none.
FAR = {"", "axisymmetric", "pair"}  # Kinds by which no edge counts, and what rows hold whose touches were not solved.
_NEAR_RIM = "near the rim"  # What mechanics_method of an earlier set says of a touch near an edge.


def near_edge(rows: pd.DataFrame) -> Mask:
    """(rows,) whether the mechanics of a touch were solved with an edge near it; of earlier rows by their words."""
    words, kinds = (rows[name] if name in rows else pd.Series(None, rows.index, dtype=object)
                    for name in (METHODS[0], KIND))
    earlier = words.astype(str).str.contains(_NEAR_RIM, regex=False)
    return np.array([not FAR.issuperset(kind.split(", ")) if isinstance(kind, str) else near
                     for kind, near in zip(kinds, earlier, strict=True)], dtype=bool)
