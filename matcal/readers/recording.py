"""A recording: the columns of one machine file (or of its parts), named by quantity, in SI, nothing reduced yet."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from touchcal.arrays import Array

# quantity -> SI unit of its column
QUANTITIES = {"time": "s", "displacement": "m", "force": "N", "strain": "", "stretch": "", "stress": "Pa",
              "modulus": "Pa", "normalised": "", "compliance": "1/Pa",
              "frequency": "Hz", "storage": "Pa", "loss": "Pa", "loss_tangent": "", "complex_modulus": "Pa",
              "temperature": "K",
              "current": "A", "potential": "V", "resistance": "ohm", "conductivity": "S/m",
              "deviation": "Pa", "lateral": "", "lateral_stretch": "", "volume_ratio": "",
              "relative_resistance": "", "pressure": "Pa", "cycle": "", "block": ""}

# size of a specimen that a file may state itself -> SI unit
SIZES = {"diameter": "m", "width": "m", "depth": "m", "thickness": "m", "length": "m", "height": "m", "area": "m^2"}

# keys of the lines above a table whose values name the test
_TITLE = re.compile(r"test|method|prüf|versuch|essai|m[ée]thode|ensayo|m[ée]todo|prova|试验|方法|試験")


@dataclass(frozen=True)
class Recording:
    """What a file holds, before anything is decided about the test behind it."""

    paths: tuple[Path, ...]  # the files it was read from, in order of time
    vendor: str  # name of the reader that recognised the layout (one of `vendors.readers`), "arrays" without a file
    columns: Mapping[str, Array]  # quantity (a key of QUANTITIES) -> (n,) values in SI
    names: Mapping[str, str]  # quantity -> column name in the file
    units: Mapping[str, str]  # quantity -> unit in the file
    first_line: int | None  # line of the first number in the first file, counted from 1; None without a file
    metadata: Mapping[str, str] = field(default_factory=dict)  # key -> value lines that stand above the table
    properties: Mapping[str, float] = field(default_factory=dict)  # size in the file (a key of SIZES) -> value in SI
    notes: tuple[str, ...] = ()  # what was assumed or left out, one sentence each
    specimen: tuple[str, ...] = ()  # (n,) specimen of each row, where a column names several; else empty
    part: str = ""  # which of several specimens in one file it is; "" where there is one
    cautions: tuple[str, ...] = ()  # what a user of the result must know of it, one sentence each
    synthetic: bool = False  # whether a line of its own, `touchcal-synthetic: 1`, says that nothing was measured

    def __post_init__(self) -> None:
        if unknown := sorted(set(self.columns) - set(QUANTITIES)):
            raise ValueError(f"recording: quantity '{unknown[0]}' is unknown; known: {', '.join(QUANTITIES)}.")
        if unknown := sorted(set(self.properties) - set(SIZES)):
            raise ValueError(f"recording: size '{unknown[0]}' is unknown; known: {', '.join(SIZES)}.")
        columns = {}
        for quantity, values in self.columns.items():
            columns[quantity] = np.array(values, dtype=float)
            columns[quantity].setflags(write=False)
        object.__setattr__(self, "columns", columns)
        if len({c.shape for c in columns.values()}) != 1 or not self.paths or (
                self.specimen and len(self.specimen) != self.rows):
            raise ValueError("recording: at least one path, and columns of one length, are needed.")

    @property
    def rows(self) -> int:
        """Number of samples."""
        return next(iter(self.columns.values())).size

    @property
    def titles(self) -> tuple[tuple[str, str], ...]:
        """(key, value) of the lines above the table that name the test or its method, the test's own line first."""
        own = [(key, self.metadata[key]) for key in ("Test", "File Path") if key in self.metadata]
        others = [(key, value) for key, value in self.metadata.items() if _TITLE.search(key.lower())]
        return tuple(dict.fromkeys([*own, *others]))

    @property
    def label(self) -> str:
        """Name for messages: the first file's, with the number of further parts, and the specimen in it."""
        first, *more = self.paths
        name = f"{first.name} and {len(more)} more parts" if more else first.name
        return f"{name} ({self.part})" if self.part else name
