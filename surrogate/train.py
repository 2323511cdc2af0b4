"""Train a surrogate on a data set."""

from __future__ import annotations

import importlib.metadata
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surrogate import outputs
from surrogate.model import Calibration, Model, Range, Rows, check_method, estimate
from surrogate.samples import Samples, content_hash, take
from surrogate.split import PARTS, split

Progress = Callable[[Iterable[int]], Iterable[int]]


def train(samples: Samples, method: str, names: tuple[str, ...] = outputs.NAMES, seed: int = 0, *,
          epochs: int | None = None, each: Progress = iter) -> Model:
    """Train `method` for the outputs of these names; of the touches 70 % train, 15 % calibrate, 15 % test,
    by the seed.

    `epochs` bounds the steps of trainbr; `each` may show progress over its networks. ValueError for an unknown method,
    too few rows, or data that the method cannot learn.
    """
    check_method(method)
    if epochs is not None and method != "trainbr":
        raise ValueError(f"epochs are steps of trainbr; {method} has none. Leave them out.")
    part = split(samples.touch, seed)
    chosen = [outputs.NAMES.index(name) for name in names]
    training, validation = take(samples, part == "train"), take(samples, part == "val")
    _check_signals(training)
    begun = time.process_time()
    learner, record = _learn(training, method, names, chosen, seed, epochs, each)
    fit_s = time.process_time() - begun
    target = training.target[:, chosen]
    span = Range(target.min(0), target.max(0), float(np.linalg.norm(training.signal_V, axis=1).min()), 0.0)
    model = Model(method, samples.ring, names, learner, Calibration(validation.signal_V, validation.target[:, chosen]),
                  Rows(samples.row_hash, _codes(part)), span, samples.baseline_V.mean(0), seed, fit_s,
                  {**_provenance(samples, part), "training": record})
    worst = float(estimate(model, validation.signal_V).misfit.max())
    return replace(model, trained=replace(span, misfit=worst))


def _check_signals(samples: Samples) -> None:
    if silent := [int(s) for s, row in zip(samples.scene, samples.signal_V, strict=True) if not np.any(row)]:
        raise ValueError(f"scene {silent[0]} has no signal: every dv is 0. Mend the skin or the force of the sweep.")


def _learn(training: Samples, method: str, names: tuple[str, ...], chosen: list[int], seed: int, epochs: int | None,
           each: Progress) -> tuple[Any, dict[str, Any]]:
    """The learner, and how its training went as JSON."""
    match method:
        case "trainbr":
            from surrogate import evidence, trainbr

            options = evidence.Options() if epochs is None else evidence.Options(epochs=epochs)
            networks = trainbr.learn(training.signal_V, training.target[:, chosen], seed, options, each)
            keys = ("gamma", "alpha", "beta", "epochs", "stop", "log_evidence", "collapses", "collapsed")
            return networks, {name: {key: getattr(net, key) for key in keys} | {"parameters": len(net.weights)}
                              for name, net in zip(names, networks.networks, strict=True)}
        case "forward":
            from surrogate import touch_inversion

            inversion = touch_inversion.learn(training.ring, training.signal_V, training.target, names)
            return inversion, {"modes": len(inversion.forward.field), "signal_floor": inversion.forward.floor}
        case _:
            from surrogate import ridge

            lines = ridge.learn(training.signal_V, training.target[:, chosen])
            return lines, {name: {"components": len(line.directions.axes), "products": len(line.mean)}
                           for name, line in zip(names, lines.lines, strict=True)}


def _codes(part: NDArray[np.str_]) -> NDArray[np.int64]:
    return np.array([PARTS.index(p) for p in part], np.int64)


def _provenance(samples: Samples, part: NDArray[np.str_]) -> dict[str, Any]:
    names = ("touchcal", "numpy", "scipy", "torch")
    return {"dataset": {"sha256": content_hash(samples), "rows": len(samples), "measurement": dict(samples.measurement),
                        "split": {p: int(np.sum(part == p)) for p in PARTS}},
            "versions": {name: importlib.metadata.version(name) for name in names}}
