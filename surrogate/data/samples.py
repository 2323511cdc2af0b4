"""Rows that a learner is taught by: signals with what is to be read of them; and those of a sweep, with its sensor and
a hash that recognises each row."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from eitsim.scene.drive import voltage_columns
from eitsim.sweeps.dataset.parquet import MANIFEST, OTHER_PROFILES, RELAXATION, TOUCH, Dataset, read_dataset
from eitsim.sweeps.dataset.touch_kinds import near_edge
from eitsim.sweeps.design import nested_design
from eitsim.sweeps.measurement.instrument_table import TABLE
from surrogate.data import material_states, outputs
from surrogate.data.sensor_ring import Ring, ring_of_design
from touchcal.arrays import Array, Index, Mask
from touchcal.errors import InputFileError

PARTS = ("train", "val", "test")
FRACTIONS = (0.70, 0.15)
# What a row states of its signal's error over the standard deviation of that error: of 25 flat punches against finer
# meshes, 0.34 of the stated in the root mean square, 0.69 at most (benchmarks/touch_errors.py).
STATED_PER_SD = 3.0
MIN_TOUCHES = 20  # fewest touches that give each part a few


@dataclass(frozen=True, kw_only=True)
class Samples:
    """Signals and what is to be read of them, of a sweep or of recorded presses."""

    signal_V: Array  # (n, readings) touched minus untouched, V or the unit of the recording
    target: Array  # (n, outputs) in the units of their names
    names: tuple[str, ...]  # of the outputs
    # (n,) number that rows share which are not to be parted: of one touch or press, of a nested design those of a block
    group: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.signal_V)

    @property
    def age(self) -> Array:
        """(n,) age of the untouched frame; 0 where it was read with the touched one."""
        return np.zeros(len(self))

    def targets(self, names: Sequence[str]) -> Array:
        """(n, outputs) targets of the outputs of these names; ValueError for one that the samples lack."""
        if lacking := [name for name in names if name not in self.names]:
            raise ValueError(f"these rows say nothing of the output '{lacking[0]}'; they have "
                             f"{', '.join(self.names)}. Leave it out, or sweep again.")
        return self.target[:, [self.names.index(name) for name in names]]


@dataclass(frozen=True, eq=False)
class OtherProfile:
    """Touches by punches of a profile that is not the samples' own."""

    profile: str
    touch: Array  # (n, 4) x, y, d, mm, and F, N
    signal_V: Array  # (n, readings) touched minus untouched, V


@dataclass(frozen=True, kw_only=True)
class SweepSamples(Samples):
    """Solved scenes of one sensor; targets are those of outputs.ALL that the data set has."""

    names: tuple[str, ...] = outputs.NAMES
    ring: Ring
    scene: NDArray[np.int64]  # (n,) scene numbers
    baseline_V: Array  # (n, readings) untouched, V
    # (n,) number of each row's card among the draws of the posterior, -1 where one card serves all
    card: NDArray[np.int64]
    # (n, q) what each row's card answers, see `surrogate.data.material_states`; q = 0 where one card serves all
    material: Array
    # (n,) standard deviation of the simulator's own relative error of the signal, 2-norm
    signal_sd: Array
    # (n,) hash of each row's number and targets: the same however its readings were measured
    row_hash: NDArray[np.uint64]
    near_edge: Mask  # (n,) whether the mechanics of the touch were solved with an edge near it
    # the [measurement] that an instrument's rows were made by, its seed left aside; empty where rows are clean
    measurement: Mapping[str, Any] = field(default_factory=dict)
    relaxation: Mapping[str, Any] = field(default_factory=dict)  # the manifest's, empty where none is stated
    profile: str = ""  # of the punch, in words
    others: tuple[OtherProfile, ...] = ()  # touches by other profiles, each read by what the rows teach


def read_samples(data: SweepSamples | Dataset | Path | str, fewest: int = 1) -> SweepSamples:
    """The ok rows of a data set or of its folder, or samples as they are; InputFileError where it is none, has no ok
    row or one of several touches, or a column lacks numbers, and ValueError, before the untouched sensor is solved,
    where it has fewer rows than `fewest`."""
    if isinstance(data, SweepSamples):
        return data
    folder = Path("data set") if isinstance(data, Dataset) else Path(data)
    if not isinstance(data, Dataset):
        if not folder.is_dir():
            raise InputFileError(folder, "no such folder. Give the folder that `eitsim sweep --out` wrote.")
        data = read_dataset(folder)
    if 0 < len(data.ok) < fewest:
        raise _too_few(f"{len(data.ok)} ok rows")
    try:
        ring = ring_of_design(data.design["tables"], _untouched(data.ok), _places(data.ok))
    except ValueError as error:
        raise InputFileError(folder, str(error)) from None
    return replace(_samples(folder, data, ring), others=_others(data.folder / OTHER_PROFILES))


def _samples(folder: Path, data: Dataset, ring: Ring) -> SweepSamples:
    rows = data.ok
    if rows.empty:
        counts = ", ".join(f"{n} {name}" for name, n in data.table["outcome"].value_counts().items())
        raise InputFileError(folder, f"none of its {len(data.table)} rows is ok ({counts}); there is nothing to learn "
                                     "from. Fix the design and sweep again.")
    _check_one_touch(folder, rows)
    readings = len(ring.read)
    touched = _numbers(folder, rows, voltage_columns(readings))
    signal = _numbers(folder, rows, voltage_columns(readings, "dv"))
    known = [output for output in outputs.ALL if output.name in outputs.TOUCHES or output.column in rows]
    target = _numbers(folder, rows, [output.column for output in known])
    scene = rows["scene"].to_numpy(np.int64)
    group = _touches(data.design["sampler"], scene, rows)
    laws = data.manifest.get("card", {}).get("laws", {})
    material = material_states.answers(rows, "hold" in data.design["tables"], laws)
    measurement = {key: value for key, value in data.manifest.get(TABLE, {}).items() if key != "seed"}
    signal_sd = _numbers(folder, rows, ["signal_error"])[:, 0] / STATED_PER_SD
    return SweepSamples(signal_V=signal, target=target, names=tuple(output.name for output in known), group=group,
                        ring=ring, scene=scene, baseline_V=touched - signal,
                        card=rows["card_sample"].to_numpy(np.int64), material=material, signal_sd=signal_sd,
                        row_hash=_hashes(scene, target), near_edge=near_edge(rows), measurement=measurement,
                        relaxation=data.manifest.get(RELAXATION, {}), profile=_profile(data.design["tables"]))


def _others(folder: Path) -> tuple[OtherProfile, ...]:
    """The touches of other profiles that a sweep solved next to its own; none where it solved none."""
    if not (folder / MANIFEST).exists():
        return ()
    rows = read_dataset(folder).ok
    readings = sum(name.startswith("dv_") for name in rows.columns)
    return tuple(OtherProfile(str(name), _numbers(folder, one, [*TOUCH]),
                              _numbers(folder, one, voltage_columns(readings, "dv")))
                 for name, one in rows.groupby("punch_profile"))


def _profile(tables: Mapping[str, Any]) -> str:
    punch = tables.get("punch", {})
    if isinstance(punch, Mapping) and punch.get("shape"):
        return f"shape {Path(str(punch['shape'])).name}"
    stated = punch.get("profile", "flat") if isinstance(punch, Mapping) else "flat"
    one = isinstance(stated, str)
    return f"profile {stated}" if one else "profiles " + ", ".join(map(str, next(iter(stated.values()))))


def _untouched(rows: pd.DataFrame) -> Array | None:
    """(readings,) mean of the untouched frames, V; None without rows or with cells that hold no numbers."""
    touched = [name for name in rows.columns if name.startswith("v_")]
    if rows.empty or not touched or any(f"d{name}" not in rows.columns for name in touched):
        return None
    found = rows[touched].to_numpy(np.float64) - rows[[f"d{name}" for name in touched]].to_numpy(np.float64)
    mean = found.mean(axis=0)
    return mean if np.all(np.isfinite(mean)) else None


def _places(rows: pd.DataFrame) -> Array | None:
    """(n, 2) places of touches, mm; None without columns of them."""
    if any(name not in rows.columns for name in TOUCH[:2]):
        return None
    found = rows[list(TOUCH[:2])].to_numpy(np.float64)
    return found[np.isfinite(found).all(axis=1)]


def _check_one_touch(folder: Path, rows: pd.DataFrame) -> None:
    if "touches" not in rows.columns:
        return
    several = rows.loc[rows["touches"] > 1, ["scene", "touches"]]
    if len(several):
        first = several.iloc[0]
        raise InputFileError(folder, f"{len(several)} rows have several touches (scene {int(first['scene'])}: "
                                     f"{int(first['touches'])}), and a surrogate learns the place and the force of "
                                     "one. Sweep a design with one touch a row.")


def _touches(sampler: str, scene: NDArray[np.int64], rows: pd.DataFrame) -> NDArray[np.int64]:
    """(n,) the block of a nested design, else the number of each different place, diameter and force."""
    if sampler == nested_design.SAMPLER:
        return scene // nested_design.BLOCK
    same = [*TOUCH, *(name for name in ("z_mm",) if name in rows)]
    return rows.groupby(same, sort=False, dropna=False).ngroup().to_numpy(np.int64)


def _numbers(folder: Path, rows: pd.DataFrame, names: list[str]) -> Array:
    if missing := [name for name in names if name not in rows.columns]:
        raise InputFileError(folder, f"the column {missing[0]} is missing; {len(names)} of its kind were expected for "
                                     "its electrodes and drive.")
    values = rows[names].to_numpy(np.float64)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        row, column = bad[0]
        raise InputFileError(folder, f"{names[column]} of scene {rows['scene'].iloc[row]} is {values[row, column]}, "
                                     "though the row says ok. Sweep that part again.")
    return values


def _hashes(scene: NDArray[np.int64], target: Array) -> NDArray[np.uint64]:
    rows = np.ascontiguousarray(np.column_stack([scene, target]))
    return np.array([int.from_bytes(hashlib.sha256(row.tobytes()).digest()[:8], "little") for row in rows], np.uint64)


def content_hash(samples: SweepSamples) -> str:
    """sha256 of the rows and their signals, in their order."""
    return hashlib.sha256(samples.row_hash.tobytes() + np.ascontiguousarray(samples.signal_V).tobytes()).hexdigest()


Kind = TypeVar("Kind", bound=Samples)


def take(samples: Kind, rows: Index | Mask) -> Kind:
    """The samples of these rows."""
    return replace(samples, **{part.name: getattr(samples, part.name)[rows] for part in fields(samples)
                               if isinstance(getattr(samples, part.name), np.ndarray)})


def _too_few(rows: str) -> ValueError:
    return ValueError(f"{rows} are too few to train, validate and test on; at least {MIN_TOUCHES} are needed. Sweep "
                      "more scenes.")


def split(group: ArrayLike, seed: int) -> NDArray[np.str_]:
    """(n,) the part of each row: 70 % of the touches train, 15 % val, the rest test, drawn by the seed.

    group: (n,) number that rows share which are not to be parted, as one touch with several cards. ValueError for fewer
    than MIN_TOUCHES different ones.
    """
    _, first, place = np.unique(group, return_index=True, return_inverse=True)
    count = len(first)
    if count < MIN_TOUCHES:
        rows = f"{len(place)} ok rows" + (f" of {count} different touches" if count < len(place) else "")
        raise _too_few(rows)
    train, val = (round(fraction * count) for fraction in FRACTIONS)
    labels = np.repeat(PARTS, [train, val, count - train - val])
    drawn = np.random.default_rng(seed).permutation(labels)
    return drawn[np.argsort(np.argsort(first))][place]
