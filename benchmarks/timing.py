"""CPU time of short runs."""

import time
from collections.abc import Callable

# CPU clocks may move in steps of 4 ms, so that less than several of them tells little
BATCH_S = 0.06


def least_cpu_s(run: Callable[[], object], batches: int = 2) -> float:
    """Least CPU time of a run, s, over so many batches that each take BATCH_S at least."""
    count = 1
    spent = [_mean_s(run, count)]
    while spent[-1] * count < BATCH_S:
        count *= 2
        spent = [_mean_s(run, count)]
    return min(spent + [_mean_s(run, count) for _ in range(batches - 1)])


def _mean_s(run: Callable[[], object], count: int) -> float:
    begun = time.process_time()
    for _ in range(count):
        run()
    return (time.process_time() - begun) / count
