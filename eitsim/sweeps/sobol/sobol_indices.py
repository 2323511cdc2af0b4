"""What makes the variance of a nested data set: touch, material and, of readings, noise."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from eitsim.scene.drive import voltage_columns
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.design import nested_design
from eitsim.sweeps.measurement.instrument import Measurement
from eitsim.sweeps.measurement.instrument_table import TABLE
from eitsim.sweeps.measurement.noise_summary import volts
from eitsim.sweeps.run.measure import Lab, lab_of, read
from eitsim.sweeps.run.row_columns import numbered
from eitsim.sweeps.sobol.variance_components import Array, Shares, Variances, joined, pooled, shares, variances
from touchcal.errors import InputFileError

FACTORS = ("touch", "material", "noise")  # The axes of a block, noise only where a measurement is there.
VECTORS = ("dv", "v")  # Vectors that are given as a whole: prefix of their columns.
_SAME = 1e-6  # Share by which a key may differ between the cards of one touch and still be the touch's.


@dataclass(frozen=True)
class Blocks:
    """The whole blocks of a nested data set."""

    # (n, 2, 2, P) outputs by touch and card, or (n, 2, 2, 2, P) by touch, card and noise; units as the names say, V
    values: Array
    names: tuple[str, ...]  # (P,) names of the outputs
    keys: Mapping[str, Array]  # key of the touch or the depth -> (n, 2, 2) its values by touch and card
    # (n, 2) numbers of the two cards of each block in the posterior's file, which come again in other blocks
    cards: NDArray[np.int64]
    failed: int  # blocks dropped because a row of theirs did not end ok
    unfinished: int  # blocks of the design whose rows are not all there yet


@dataclass(frozen=True)
class Indices:
    """Shares of the variance of every output, and of the readings together."""

    factors: tuple[str, ...]  # some of FACTORS
    names: tuple[str, ...]  # outputs, then VECTORS, rms over their readings
    mean: Array  # mean of each output; rms of each vector
    shares: Shares  # indices, deviations and spreads of all of them
    within: Array | None  # spread by the material alone among the touches asked for, (names,); None where none were
    touches: int  # touches that it is from


def read_blocks(folder: Path, measurement: Measurement | None = None) -> Blocks:
    """The whole blocks of a nested data set, measured with and without its design's noise where it has one.

    measurement: in place of that of the design. InputFileError where the folder is no data set, its rows are measured
    already, or they are not nested.
    """
    data = parquet.read_dataset(folder)
    if data.design["sampler"] != nested_design.SAMPLER:
        raise InputFileError(folder, f"its sampler is \"{data.design['sampler']}\", and variances are parted from rows "
                                     "that share a touch or a card. Sweep with sampler = "
                                     f"\"{nested_design.SAMPLER}\" and a table [material].")
    if "clean" in data.manifest:
        raise InputFileError(folder, "its rows are measured, each with noise of its own. Give the clean set; the noise "
                                     "of its design, or of --model, is then a factor.")
    rows, failed, whole = _whole_blocks(data.table)
    if rows.empty:
        raise InputFileError(folder, f"no block of {nested_design.BLOCK} rows is ok ({failed} with a row that failed). "
                                     "Sweep more scenes, or fix the design.")
    lab = lab_of(folder, data.manifest, measurement) if measurement or data.design.get(TABLE) else None
    corners = (len(rows) // nested_design.BLOCK, *nested_design.SHAPE)
    values, names = _outputs(rows, lab)
    keys = {key: rows[key].to_numpy(np.float64).reshape(corners) for key in (*parquet.TOUCH, "delta_max_mm")}
    cards = rows["card_sample"].to_numpy(np.int64).reshape(corners)[:, 0, :]
    return Blocks(values, names, keys, cards, failed, data.design["scenes"] // nested_design.BLOCK - whole)


def _whole_blocks(table: pd.DataFrame) -> tuple[pd.DataFrame, int, int]:
    """Rows of the blocks all of whose rows are ok; the number of those of which one is not, and of all that are there.
    """
    block = table["scene"].to_numpy() // nested_design.BLOCK
    _, place, count = np.unique(block, return_inverse=True, return_counts=True)
    good = np.bincount(place, (table["outcome"] == "ok").to_numpy()) == nested_design.BLOCK
    whole = int(np.sum(count == nested_design.BLOCK))
    return table.loc[good[place]].reset_index(drop=True), whole - int(good.sum()), whole


def _outputs(rows: pd.DataFrame, lab: Lab | None) -> tuple[Array, tuple[str, ...]]:
    """Outputs at all corners, and their names; readings that need a missing electrode, and touches that not every row
    has, are left out."""
    touched, signal = volts(rows)
    names = _mechanical(rows)
    plain, there = rows[names].to_numpy(np.float64), np.all(np.isfinite(signal), axis=0)
    for prefix in VECTORS:
        columns = voltage_columns(signal.shape[1], prefix)
        names += [name for name, kept in zip(columns, there.tolist(), strict=True) if kept]
    sets = [(touched, signal)]
    if lab is not None:
        block = rows["scene"].to_numpy() // nested_design.BLOCK
        found = [read(lab, touched, signal, 2 * block + which) for which in (0, 1)]
        sets = [(one.touched_V, one.signal_V) for one in found]
    values = np.stack([np.hstack([plain, dv[:, there], v[:, there]]) for v, dv in sets], axis=1)
    corners = (len(rows) // nested_design.BLOCK, *nested_design.SHAPE, *((2,) if lab is not None else ()))
    return values.reshape(*corners, len(names)), tuple(names)


def _mechanical(rows: pd.DataFrame) -> list[str]:
    """Outputs of the touches that every row has."""
    full = {name for name in rows.columns if not pd.isna(rows[name].to_numpy()).any()}
    each = ([numbered(name, k) for name in parquet.OUTPUTS] for k in itertools.count())
    return list(itertools.chain.from_iterable(itertools.takewhile(full.issuperset, each)))


def indices_of(blocks: Blocks, *, within: Mapping[str, tuple[float, float]] | None = None) -> Indices:
    """First-order and total indices of every output and of the readings together, with 95 % intervals for touches and
    cards drawn again.

    within: key of a touch -> (lowest, highest), for the spread by the material among those touches. ValueError for an
    unknown key, one that differs between the cards of a touch, or where no touch lies within.
    """
    parts = variances(blocks.values)
    vectors = [[name.startswith(f"{prefix}_") for name in blocks.names] for prefix in VECTORS]
    flat = blocks.values.reshape(-1, len(blocks.names))
    size = np.sqrt((flat**2).mean(axis=0))
    rms = np.concatenate([size, [np.sqrt((size[which]**2).mean()) for which in vectors]])
    picked = (Variances(parts.first[..., which], parts.total[..., which], parts.whole[..., which]) for which in vectors)
    found = shares(joined(parts, *map(pooled, picked)), rms, cards=blocks.cards)
    mean = np.concatenate([flat.mean(axis=0), rms[len(size):]])
    spread, touches = None, blocks.values.shape[0] * 2
    if within:
        inside = _inside(blocks, within)
        spread, touches = _spread(blocks.values, inside, vectors), int(inside.sum())
    return Indices(FACTORS[:blocks.values.ndim - 2], (*blocks.names, *VECTORS), mean, found, spread, touches)


def _inside(blocks: Blocks, within: Mapping[str, tuple[float, float]]) -> NDArray[np.bool_]:
    """(n, 2) whether each touch lies within all ranges."""
    inside = np.ones(blocks.values.shape[:2], dtype=bool)
    for key, (low, high) in within.items():
        if key not in blocks.keys:
            raise ValueError(f"'{key}' is no key of a touch; known: {', '.join(blocks.keys)}.")
        value = blocks.keys[key]
        if np.any(np.ptp(value, axis=2) > _SAME * np.abs(value).max(axis=2)):
            other = "delta_max_mm" if key == "F_N" else "F_N"
            raise ValueError(f"{key} differs between the two cards of a touch, so that it is not the touch's own; give "
                             f"a range of {other}.")
        inside &= (value[:, :, 0] >= low) & (value[:, :, 0] <= high)
    if not inside.any():
        held = ", ".join(f"{key} {value.min():.4g} to {value.max():.4g}" for key, value in blocks.keys.items()
                         if key in within)
        raise ValueError(f"no touch lies within the ranges asked for; the data set holds {held}.")
    return inside


def _spread(values: Array, inside: NDArray[np.bool_], vectors: list[list[bool]]) -> Array:
    """sqrt E[V[output | touch]] over those touches, of outputs and, rms over their readings, of vectors."""
    variance = (np.diff(values, axis=2).squeeze(2)[inside]**2 / 2).reshape(-1, values.shape[-1]).mean(axis=0)
    return np.sqrt(np.concatenate([variance, [variance[which].mean() for which in vectors]]))
