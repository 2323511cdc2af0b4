"""Tables of a dynamic test (DMA, rheometer): storage and loss modulus over frequency, at one temperature or several."""

import numpy as np
from numpy.typing import NDArray

from matcal.readers.dynamic_words import is_stiffness
from matcal.readers.recording import Recording
from matcal.reduction.experiment import Experiment, Sweep
from matcal.reduction.tables.modulus_symbol import symbol_of
from touchcal.arrays import Array
from touchcal.errors import InputFileError

# K by which temperatures of one sweep differ at most from row to row, and those of two sweeps at one temperature
_STEP, _SAME = 2.0, 1.0
_FEWEST = 4  # rows of a sweep


def reduce_sweeps(recording: Recording) -> Experiment:
    """Storage and loss modulus of each row, rows of one temperature together; InputFileError where a column that is
    needed is missing or not above 0."""
    columns, names = recording.columns, recording.names
    if "frequency" not in columns:
        raise _error(recording, "a dynamic test needs a frequency column (Hz, rad/s) or the period with its unit (s); "
                                f"found: {', '.join(names.values())}.")
    storage, loss = _moduli(recording)
    for quantity, values in (("frequency", columns["frequency"]), ("storage modulus", storage), ("loss modulus", loss)):
        if values.min() <= 0:
            raise _error(recording, f"the {quantity} falls to {values.min():.4g}, and it is above 0. Are two columns "
                                    "exchanged?")
    group, temperature = _sweeps(columns["frequency"], columns.get("temperature"))
    counts = np.bincount(group)
    if counts.min() < _FEWEST:
        where = f" at {temperature[counts.argmin()] - 273.15:.4g} C" if temperature.size else ""
        raise _error(recording, f"a sweep{where} has {counts.min()} rows. Give at least {_FEWEST} frequencies at each "
                                "temperature.")
    named = names.get("storage", names.get("complex_modulus", names.get("loss", "")))
    symbol = symbol_of(named)
    said = [] if not is_stiffness(named) else [
        f"Column '{named}' is a stiffness, so that the series is fitted, which needs no size of the specimen, and no "
        "modulus is stated: that is stiffness x height/area, or x thickness/(faces x area) in shear."]
    if said:
        symbol, storage, loss = "table_normalised", storage / storage.max(), loss / storage.max()
    said += [f"{counts.size} sweep{'s' if counts.size > 1 else ''} of {storage.size} rows, "
            f"{columns['frequency'].min():.4g} to {columns['frequency'].max():.4g} Hz."]
    if temperature.size:
        said.append("Temperatures: " + ", ".join(f"{t - 273.15:.4g}" for t in temperature) + " C.")
    return Experiment("dma", np.zeros(storage.size), storage, source=tuple(p.name for p in recording.paths),
                      facts={symbol: 1.0, "sweeps": float(counts.size)}, decisions=(*recording.notes, *said),
                      sweep=Sweep(columns["frequency"], loss, group, temperature))


def _moduli(recording: Recording) -> tuple[Array, Array]:
    """Storage and loss modulus, Pa, each from its column or from the other and the loss tangent."""
    columns = recording.columns
    tangent, size = columns.get("loss_tangent"), columns.get("complex_modulus")
    storage, loss = columns.get("storage"), columns.get("loss")
    if storage is None and size is not None and tangent is not None:
        storage = size / np.sqrt(1 + tangent**2)
    if storage is None and loss is not None and tangent is not None:
        storage = loss / tangent
    if loss is None and storage is not None and tangent is not None:
        loss = storage * tangent
    if storage is None or loss is None:
        raise _error(recording, "a dynamic test needs storage and loss modulus, or one of them and the loss tangent; "
                                f"found: {', '.join(recording.names.values())}.")
    return storage, loss


def _sweeps(frequency: Array, temperature: Array | None) -> tuple[NDArray[np.intp], Array]:
    """(n,) sweep of each row by increasing temperature, and the mean temperature of each: rows whose frequencies run
    in one direction, or, where the frequency stands while the temperature moves, rows of like temperature."""
    if temperature is None:
        return np.zeros(frequency.size, dtype=int), np.zeros(0)
    moved = np.sign(np.diff(np.log(frequency)))
    if np.count_nonzero(moved) < 0.5 * moved.size:
        order = np.argsort(temperature, kind="stable")
        run = np.empty(frequency.size, dtype=int)
        run[order] = np.r_[0, np.cumsum(np.diff(temperature[order]) > _STEP)]
    else:
        turned = (moved != np.sign(np.median(moved))) | (np.abs(np.diff(temperature)) > _STEP)
        run = np.r_[0, np.cumsum(turned)]
    means = np.array([temperature[run == k].mean() for k in range(run.max() + 1)])
    order = np.argsort(means, kind="stable")
    joined = np.empty(means.size, dtype=int)
    joined[order] = np.r_[0, np.cumsum(np.diff(means[order]) > _SAME)]
    group = joined[run]
    return group, np.array([temperature[group == k].mean() for k in range(group.max() + 1)])


def _error(recording: Recording, problem: str) -> InputFileError:
    return InputFileError(recording.paths[0], problem, line=recording.first_line)
