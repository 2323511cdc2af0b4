"""Train a surrogate on a data set."""

import importlib.metadata
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.sweeps.dataset.parquet import Dataset
from surrogate.data.outputs import TOUCH
from surrogate.data.outputs import chosen as chosen_outputs
from surrogate.data.samples import MIN_TOUCHES, PARTS, SweepSamples, content_hash, read_samples, split, take
from surrogate.data.sensor_ring import same_ring
from surrogate.learners.base import Learner, Progress, Training
from surrogate.learners.registry import listed, method_of
from surrogate.model.sweep_model import SweepModel
from surrogate.model.trained import Calibration, Range, Rows, estimate

# Fewest rows of another set that calibrate intervals: as many as have an order statistic at 95 %.
MIN_CALIBRATING = 19


def train(data: SweepSamples | Dataset | Path | str, method: str = "forward", outputs: str | Sequence[str] = "all",
          seed: int = 0, *, epochs: int | None = None, workers: int = 1, each: Progress = iter,
          calibrate: SweepSamples | Dataset | Path | str | None = None, exact_signals: bool = False,
          known_punches: bool = False) -> SweepModel:
    """Train a surrogate on a data set: of the touches 70 % train, 15 % calibrate the intervals, 15 % test, by the seed.

    Parameters
    ----------
    data : Dataset, path or SweepSamples
        Solved scenes of one sensor with one touch each, or the folder that `eitsim sweep` wrote.
    method : str
        One of `METHODS`.
    outputs : "all", a comma-separated text or a sequence
        Names among x0, y0, d, F, sigma_max, sigma_ave, A_c, delta_max, and z0 of curved
        skins.
    seed : int
        Seed of the split and of the networks.
    epochs : int, optional
        Most steps of an iterated method.
    workers : int
        Processes that share the outputs of networks; the networks are the same for any number of them.
    each : callable
        May show progress: it is given the numbers of the networks and yields them.
    calibrate : Dataset, path or SweepSamples, optional
        Rows, as of another mesh, that take the place of those 15 % when intervals are calibrated, so that these hold
        what that set shows of the model's error.
    exact_signals : bool
        Take signals for exact: what the simulator states of their error does not count. For comparing methods on
        simulated touches, not for a real sensor.
    known_punches : bool
        All touches to be read are by punches of the trained profile, of the diameters that training rows share, where
        these are a few; d and F are then surer, and wrong, with no flag, for any other punch. Method forward.

    Returns
    -------
    SweepModel

    Raises
    ------
    ValueError
        For an unknown method or output, too few rows, another sensor, or data that the method cannot learn.
    InputFileError
        Where a folder is no data set, or a damaged one.

    Examples
    --------
    >>> model = surrogate.train("sweep", method="ridge", outputs="x0,y0,F", seed=1)
    >>> model.names
    ('x0', 'y0', 'F')
    """
    chosen = method_of(method)
    if epochs is not None and not chosen.epochs:
        raise ValueError(f"epochs are steps of {listed(lambda one: one.epochs)}; {method} has none. Leave them out.")
    if epochs is not None and epochs < 1:
        raise ValueError(f"epochs must be 1 or more, got {epochs}.")
    chosen_outputs(outputs)
    samples = _read(data, exact_signals, MIN_TOUCHES)
    names = chosen_outputs(outputs, samples.names)
    part = split(samples.group, seed)
    training, validation, other = take(samples, part == "train"), take(samples, part == "val"), None
    _check_signals(training)
    if calibrate is not None:
        validation = other = _read(calibrate, exact_signals)
        _check_calibrating(samples, other)
    begun = _cpu_s()
    asked = Training(names, seed, epochs or chosen.epochs, workers, known_punches, each)
    learner = chosen.learner().fit(training, asked)
    fit_s = _cpu_s() - begun
    validation = _readable(learner, validation)
    target = training.targets(names)
    span = Range(target.min(0), target.max(0), float(np.linalg.norm(training.signal_V, axis=1).min()), 0.0)
    calibration = Calibration(validation.signal_V, validation.targets(names), validation.signal_sd)
    model = SweepModel(method, samples.ring, names, learner, calibration, _rows(samples, part, other),
                  span, samples.baseline_V.mean(0), seed, fit_s,
                  {**_provenance(samples, part, validation), "training": learner.record(asked)})
    worst = float(estimate(model, validation.signal_V).misfit.max())
    return replace(model, trained=replace(span, misfit=worst))


def _read(data: SweepSamples | Dataset | Path | str, exact_signals: bool, fewest: int = 1) -> SweepSamples:
    samples = read_samples(data, fewest)
    return replace(samples, signal_sd=np.zeros(len(samples))) if exact_signals else samples


def _readable(learner: Learner, samples: SweepSamples) -> SweepSamples:
    """The rows that a learner can read, to calibrate it; ValueError where there are none."""
    kept = learner.reads(samples.target[:, :TOUCH])
    if not kept.any():
        raise ValueError(f"all {len(kept)} rows that would calibrate the intervals lie nearer to an edge than the "
                         "touches that the method was learned from, or near two edges. Sweep more scenes far from "
                         "edges.")
    return take(samples, kept)


def _cpu_s() -> float:
    """CPU time of this process and of its ended workers, s."""
    return sum(os.times()[:4])


def _check_calibrating(samples: SweepSamples, calibrate: SweepSamples) -> None:
    if not same_ring(samples.ring, calibrate.ring):
        raise ValueError("the calibrating set is of another sensor than the training set: its disc, electrodes or "
                         "drive differ. Sweep one of the same [body], [electrodes] and [drive].")
    if len(calibrate) < MIN_CALIBRATING:
        raise ValueError(f"{len(calibrate)} calibrating rows are too few for a 95 % interval; at least "
                         f"{MIN_CALIBRATING} are needed. Sweep more scenes.")
    if shared := int(np.sum(np.isin(calibrate.row_hash, samples.row_hash))):
        raise ValueError(f"{shared} of the calibrating rows are rows of the training set too. Give a set of other "
                         "touches, such as one on another mesh.")
    _check_signals(calibrate)


def _rows(samples: SweepSamples, part: NDArray[np.str_], calibrate: SweepSamples | None) -> Rows:
    """The rows that the model has seen; those that calibrate it instead of the validation rows count as such."""
    codes = np.array([PARTS.index(p) for p in part], np.int64)
    if calibrate is None:
        return Rows(samples.row_hash, codes)
    used = np.full(len(calibrate), PARTS.index("val"))
    return Rows(np.concatenate([samples.row_hash, calibrate.row_hash]), np.concatenate([codes, used]))


def _check_signals(samples: SweepSamples) -> None:
    bad = ~(np.isfinite(samples.signal_V).all(axis=1) & np.isfinite(samples.target).all(axis=1))
    if np.any(bad):
        raise ValueError(f"scene {samples.scene[np.argmax(bad)]} holds a number that is not finite; a row that is ok "
                         "has numbers alone. Sweep that part again.")
    if silent := [int(s) for s, row in zip(samples.scene, samples.signal_V, strict=True) if not np.any(row)]:
        raise ValueError(f"scene {silent[0]} has no signal: every dv is 0. Fix the skin or the force of the sweep.")


def _provenance(samples: SweepSamples, part: NDArray[np.str_], validation: SweepSamples) -> dict[str, Any]:
    def described(rows: SweepSamples) -> dict[str, Any]:
        return {"sha256": content_hash(rows), "rows": len(rows), "measurement": dict(rows.measurement),
                "cards": len(np.unique(rows.card))}

    return {"dataset": described(samples) | {
        "profile": samples.profile, "split": {p: int(np.sum(part == p)) for p in PARTS}},
            "calibration": described(validation), "relaxation": dict(samples.relaxation),
            "versions": {name: importlib.metadata.version(name) for name in ("touchcal", "numpy", "scipy")}}
