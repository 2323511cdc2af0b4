"""A sweep on many workers, simulated event by event: workers solve parts, one parent writes them and hands out more."""

import heapq
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Schedule:
    """How such a sweep went, s."""

    # until the last part is on disk
    wall_s: float
    # that all workers spent on parts, over what they had until then
    busy: float
    # part of the wall time that the parent spent on parts
    parent_busy: float
    # from the first worker that found nothing left to do until the end
    tail_s: float


def schedule(part_s: NDArray[np.float64], workers: int, parent_s: float, start_s: float = 0.0) -> Schedule:
    """Parts that take part_s (parts,) on their worker, each then `parent_s` of a parent that takes them one by one and
    hands out another for each; two are with every worker or wait for it. Workers take `start_s` to start."""
    # (when, what a parent hands out then; None: a worker becomes free)
    events: list[tuple[float, int, float | None]] = [(start_s, k, None) for k in range(workers)]
    waiting, left = deque(part_s[:2 * workers].tolist()), deque(part_s[2 * workers:].tolist())
    idle, started, parent_free, out_of_work = 0, 0, start_s, None
    while events:
        now, order, handed = heapq.heappop(events)
        if handed is not None:
            waiting.append(handed)
        else:
            idle += 1
            if order >= workers:
                parent_free = max(parent_free, now) + parent_s
                if left:
                    heapq.heappush(events, (parent_free, order, left.popleft()))
        while idle and waiting:
            idle, started = idle - 1, started + 1
            heapq.heappush(events, (now + waiting.popleft(), workers + started, None))
        if idle and started == len(part_s) and out_of_work is None:
            out_of_work = now
    return Schedule(parent_free, float(part_s.sum()) / (workers * parent_free), len(part_s) * parent_s / parent_free,
                    parent_free - (start_s if out_of_work is None else out_of_work))
