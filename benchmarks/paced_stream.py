"""The command `surrogate predict MODEL -` at the pace of a sensor: delay from a frame's turn to its answer, and losses.

Run as `python benchmarks/paced_stream.py MODEL_DIR CARD SWEEP_DIR`, with a folder as that of `contacts.py`; writes
results/paced_stream.csv next to this file. The command runs on one core, with its start-up (start_s, to the answer of
a first untouched frame) before; then frames of the presses of `contacts.py` at 80 dB come at 50 a second for a minute.
delay_ms is wall time, from the moment that a line is due to that at which its row is read, and counts what else the
machine does; cpu_ms is the command's CPU time a frame, and cpu_delay_95_ms the delay that CPU times in turn, as the
tracker takes them in this process, leave.
"""

import os
import resource
import subprocess
import sys
import threading
import time
from pathlib import Path

import contacts
import numpy as np
import tracker
from conditions import quick, shown, written
from numpy.typing import NDArray

import surrogate

PACED_S = quick(60, 4)


def commanded(model: Path, lines: list[str]) -> dict[str, object]:
    """Delays of the answers of the command, on one core, to lines that come at tracker.RATE_HZ."""
    core = min(os.sched_getaffinity(0))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.perf_counter()
    with subprocess.Popen(["taskset", "-c", str(core), sys.executable, "-m", "surrogate", "predict", str(model), "-"],
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                          bufsize=1) as running:
        assert running.stdin is not None
        assert running.stdout is not None
        running.stdin.write(lines[0])
        running.stdout.readline()  # names of the columns
        running.stdout.readline()
        due = time.perf_counter() + 0.1 + np.arange(len(lines) - 1) / tracker.RATE_HZ
        start_s = due[0] - 0.1 - begun
        writer = threading.Thread(target=_write, args=(running.stdin, lines[1:], due))
        writer.start()
        delay = [time.perf_counter() - moment for moment, _ in zip(due, running.stdout, strict=False)]
        writer.join()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {"frames": len(due), "lost": len(due) - len(delay), "pace_per_s": tracker.RATE_HZ, "start_s": start_s,
            "delay_ms": 1e3 * float(np.median(delay)), "delay_95_ms": 1e3 * float(np.quantile(delay, 0.95)),
            "delay_most_ms": 1e3 * max(delay), "last_delay_ms": 1e3 * delay[-1],
            "cpu_s": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime}


def _write(sink: object, lines: list[str], due: NDArray[np.float64]) -> None:
    for moment, line in zip(due, lines, strict=True):
        time.sleep(max(moment - time.perf_counter(), 0.0))
        sink.write(line)  # pyright: ignore[reportAttributeAccessIssue]
    sink.close()  # pyright: ignore[reportAttributeAccessIssue]


def main() -> None:
    if len(sys.argv) != 4:
        raise SystemExit("paced_stream.py: give a forward model, its card, and a folder for the simulated touches.")
    folder, frames = Path(sys.argv[1]), 1 + round(PACED_S * tracker.RATE_HZ)
    model = surrogate.load(folder)
    press, touch = contacts.presses(contacts.PRESSES, 1)
    stream = tracker.solved(["hold"] * len(press), press, touch, sys.argv[2], Path(sys.argv[3]))
    volts = tracker.with_noise(model, stream.signal_V[:frames], np.random.default_rng(0))
    _, spent = tracker.followed(model, stream, volts)
    row = commanded(folder, [",".join(map(repr, frame)) + "\n" for frame in volts.tolist()])
    shown(written([row | {"cpu_ms": float(spent.mean()),
                          "cpu_delay_95_ms": float(np.quantile(tracker.delays(spent), 0.95))}], "paced_stream"))


if __name__ == "__main__":
    main()
