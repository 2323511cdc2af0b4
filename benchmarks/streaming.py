"""Frames a second from standard input: models answer a stream of text lines, on one core.

Lines hold the validation rows of each model with noise of 1e-6 V. `waiting` lets all frames wait, so that they are
answered 32 at a time; `lone` gives one at a time, and tells how long an answer takes. CPU time, without start-up (the
calibration of the intervals), which start_s tells. Run as `python benchmarks/streaming.py MODEL_DIR...`; writes
results/streaming.csv beside this file.
"""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path

import numpy as np
from conditions import quick, shown, written

from surrogate import store
from surrogate.frame_lines import BATCH, frames_of
from surrogate.model import Model
from surrogate.predict import prepare
from surrogate.stream import answers

FRAMES, LONE, NOISE_V = *quick((512, 128), (64, 8)), 1e-6


def row(model: Model, most: int, frames: int) -> dict[str, object]:
    """Rate of one model, at most so many lines at a time."""
    rng = np.random.default_rng(0)
    signal = model.calibration.signal_V[np.arange(frames) % len(model.calibration.signal_V)]
    volts = model.baseline_V + signal + NOISE_V * rng.normal(size=signal.shape)
    lines = [(number, ",".join(map(repr, frame))) for number, frame in enumerate(volts.tolist(), start=1)]
    order = np.arange(volts.shape[1])
    begun = time.process_time()
    predictor = prepare(model, model.baseline_V, NOISE_V)
    answers(predictor, frames_of(lines[:1], order))
    start_s, begun, sink = time.process_time() - begun, time.process_time(), io.StringIO()
    for first in range(0, frames, most):
        read = frames_of(lines[first:first + most], order)
        sink.writelines(",".join(cells) + "\n" for cells in answers(predictor, read))
    spent = time.process_time() - begun
    return {"method": model.method, "outputs": len(model.names), "rows": len(model.rows.part),
            "mode": "lone" if most == 1 else "waiting", "frames": frames, "ms_a_frame": spent / frames * 1e3,
            "frames_per_s": frames / spent, "start_s": start_s}


def main() -> None:
    models = [store.load(Path(name)) for name in sys.argv[1:]]
    if not models:
        raise SystemExit("streaming.py: give folders of models, from `surrogate train`.")
    shown(written([row(model, most, frames) for model in models for most, frames in ((BATCH, FRAMES), (1, LONE))],
                  "streaming"))


if __name__ == "__main__":
    main()
