"""Frames a second from standard input: models answer a stream of text lines, on one core.

Lines hold the validation rows of each model with noise of 1e-6 V. `waiting` lets all frames wait, so that they are
answered 32 at a time; `lone` gives one at a time, and tells how long an answer takes. Both count CPU time, without
start-up (the calibration of the intervals), which start_s tells. `paced` writes lines into a pipe at the pace of a
sensor, as `surrogate predict -` reads them: frames_per_s and delay_ms, from a line's turn to its answer, are wall time,
and a model keeps up where frames_per_s is nearly the pace. Run as `python benchmarks/streaming.py MODEL_DIR...`; writes
results/streaming.csv next to this file.
"""

import io
import os
import sys
import threading
import time
from pathlib import Path

import numpy as np
from conditions import quick, shown, written

import surrogate
from surrogate.data.frame_rows import BATCH, Lines, frames_of, in_order, waiting_lines
from surrogate.data.frame_source import widen_pipe
from surrogate.model.predict import Predictor, prepare, read_touches
from surrogate.model.stream import rows_of
from surrogate.model.sweep_model import SweepModel

FRAMES, LONE, NOISE_V = *quick((512, 128), (64, 8)), 1e-6
# lines a second of a paced stream: of a map that is inverted, and of what answers at once; and for how long, s
INVERTED, DIRECT, PACED_S = 50, 1000, quick(20, 2)


def answered(predictor: Predictor, lines: Lines) -> list[list[str]]:
    """Rows of predictions of some lines."""
    return rows_of(predictor.model, lines, read_touches(predictor, lines))


def lines_of(model: SweepModel, frames: int) -> list[str]:
    """Lines of text that a model is asked."""
    rng = np.random.default_rng(0)
    signal = model.calibration.signal_V[np.arange(frames) % len(model.calibration.signal_V)]
    volts = model.baseline_V + signal + NOISE_V * rng.normal(size=signal.shape)
    return [",".join(map(repr, frame)) for frame in volts.tolist()]


def row(model: SweepModel, most: int, frames: int) -> dict[str, object]:
    """Rate of one model, at most so many lines at a time."""
    lines = list(enumerate(lines_of(model, frames), start=1))
    order = in_order(len(model.baseline_V))
    begun = time.process_time()
    predictor = prepare(model, model.baseline_V, NOISE_V)
    answered(predictor, frames_of(lines[:1], order))
    start_s, begun, sink = time.process_time() - begun, time.process_time(), io.StringIO()
    for first in range(0, frames, most):
        read = frames_of(lines[first:first + most], order)
        sink.writelines(",".join(cells) + "\n" for cells in answered(predictor, read))
    spent = time.process_time() - begun
    return {"method": model.method, "outputs": len(model.names), "rows": len(model.rows.part),
            "mode": "lone" if most == 1 else "waiting", "frames": frames, "ms_a_frame": spent / frames * 1e3,
            "frames_per_s": frames / spent, "start_s": start_s}


def paced(model: SweepModel) -> dict[str, object]:
    """Rate and delays of one model whose lines come at the pace of a sensor."""
    pace = INVERTED if model.method == "forward" else DIRECT
    lines = [f"{line}\n".encode() for line in lines_of(model, pace * PACED_S)]
    predictor, order = prepare(model, model.baseline_V, NOISE_V), in_order(len(model.baseline_V))
    read_end, write_end = os.pipe()
    widen_pipe(read_end)
    begun = time.perf_counter() + 0.1
    writer = threading.Thread(target=_write, args=(write_end, lines, begun, pace))
    writer.start()
    delay, sink = [], io.StringIO()
    with os.fdopen(read_end, "rb") as source:
        for waiting in waiting_lines(source):
            sink.writelines(",".join(cells) + "\n" for cells in answered(predictor, frames_of(waiting, order)))
            delay += [time.perf_counter() - begun - (number - 1) / pace for number, _ in waiting]
    spent = time.perf_counter() - begun
    writer.join()
    return {"method": model.method, "outputs": len(model.names), "rows": len(model.rows.part), "mode": "paced",
            "frames": len(lines), "pace_per_s": pace, "frames_per_s": len(lines) / spent,
            "delay_ms": 1e3 * float(np.median(delay)), "delay_95_ms": 1e3 * float(np.quantile(delay, 0.95)),
            "last_delay_ms": 1e3 * delay[-1]}


def _write(write_end: int, lines: list[bytes], begun: float, pace: float) -> None:
    with os.fdopen(write_end, "wb", buffering=0) as sink:
        for number, line in enumerate(lines):
            time.sleep(max(begun + number / pace - time.perf_counter(), 0.0))
            sink.write(line)


def main() -> None:
    models = [surrogate.load(Path(name)) for name in sys.argv[1:]]
    if not models:
        raise SystemExit("streaming.py: give folders of models, from `surrogate train`.")
    rows = [row(model, most, frames) for model in models for most, frames in ((BATCH, FRAMES), (1, LONE))]
    shown(written(rows + [paced(model) for model in models], "streaming"))


if __name__ == "__main__":
    main()
