"""A material card with what `matcal fit` left next to it: reduced tests, their fitted curves, the posterior."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from matcal.card import MaterialCard, read_card
from matcal.readers.vocabulary import KINDS
from touchcal.errors import InputFileError

Array = NDArray[np.float64]
VALUE = {"conductivity": "conductivity_S_per_m"}  # kind -> column of the measured value


@dataclass(frozen=True)
class Test:
    """One reduced test as it lies in the card's folder."""

    __test__ = False  # pytest: not a test class

    label: str  # KIND_i
    kind: str
    strain: Array  # (n,) nominal strain (gamma in shear, J in volumetric)
    value: Array  # (n,) nominal stress, Pa, or conductivity, S/m
    # (n,) the fitted law along the test's own history, same unit; None where nothing was fitted to it
    fitted: Array | None
    time_s: Array | None  # (n,) time, s; None without a clock

    def history(self) -> tuple[Array, Array, Array]:
        """Time, measured and fitted value; ValueError where the test has no clock or no fit."""
        if self.time_s is None or self.fitted is None:
            raise ValueError(f"{self.label} has no {'clock' if self.time_s is None else 'fit'}; fit the card again.")
        return self.time_s, self.value, self.fitted


@dataclass(frozen=True)
class Record:
    """A card and its tests."""

    path: Path
    card: MaterialCard
    tests: Mapping[str, Test]  # label -> test, in the order of the card
    files: tuple[Path, ...]  # all files of the folder
    missing: str = ""  # why there are no tests; empty where there are
    # further tables of the folder by their file's stem: bands, conductivity_band, KIND_i_cycles
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)

    def fitted(self, kind: str) -> list[Test]:
        """Tests of a kind that were fitted and whose errors the card holds."""
        return [test for test in self.tests.values()
                if test.kind == kind and test.fitted is not None and test.label in self.card.fit]


def read_record(path: Path) -> Record:
    """Read a card and the folder it names; a folder that is not there is named in `missing`. InputFileError where the
    card or a table cannot be used."""
    card = read_card(path)
    if card.data is None:
        return Record(path, card, {}, (), "The card names no folder of reduced tests, so no data are drawn.")
    folder = path.parent / card.data
    if not folder.is_dir():
        return Record(path, card, {}, (), f"The folder {card.data} that the card names is not next to it, so no data "
                                         "are drawn.")
    files = tuple(sorted(p for p in folder.iterdir() if p.is_file()))
    tables = {p.stem: p for p in files if p.suffix == ".parquet"}
    tests = {stem: _read_test(table) for stem, table in tables.items() if _is_test(stem)}
    others = {stem: _table(table) for stem, table in tables.items() if not _is_test(stem)}
    drawn = bool(tests) or any(stem.startswith(("dma_", "creep_")) for stem in others)
    missing = "" if drawn else f"The folder {card.data} holds no reduced test, so no data are drawn."
    return Record(path, card, tests, files, missing, others)


def rows_where(table: pd.DataFrame, keep: ArrayLike) -> pd.DataFrame:
    """Rows of a table where `keep` (n,) holds."""
    return pd.DataFrame(table[np.asarray(keep, dtype=bool)])


def _is_test(stem: str) -> bool:
    """Whether a table is called KIND_i."""
    kind, _, number = stem.rpartition("_")
    return kind in KINDS and kind not in ("dma", "creep") and number.isdigit()


def _table(path: Path) -> pd.DataFrame:
    try:
        return pd.read_parquet(path, page_checksum_verification=True)
    except (OSError, ValueError) as error:
        why = str(error).splitlines()[0]
        raise InputFileError(path, f"no table that `matcal fit` wrote, or a damaged one ({why}). Fit the card again."
                             ) from None


def _read_test(path: Path) -> Test:
    kind = path.stem.rsplit("_", 1)[0]
    table, value = _table(path), VALUE.get(kind, "stress_Pa")
    for name in ("strain", value):
        if name not in table:
            raise InputFileError(path, f"the column {name} is missing. Fit the card again.")

    def column(name: str) -> Array | None:
        return table[name].to_numpy(dtype=float) if name in table else None

    return Test(path.stem, kind, table["strain"].to_numpy(dtype=float), table[value].to_numpy(dtype=float),
                column(f"fit_{value}"), column("time_s"))
