"""What a run costs: times since it began, and memory."""

import resource
import sys
import time
from collections.abc import Callable

from touchcal.jit import compilation_s, cpu_s


def cost_from_here() -> Callable[[], dict[str, float]]:
    """A function that answers what has been spent since: cpu_s, without compilation_cpu_s, and wall_s, s; and peak_MB.

    >>> sorted(cost_from_here()())
    ['compilation_cpu_s', 'cpu_s', 'peak_MB', 'wall_s']
    """
    wall, cpu, compiling = time.perf_counter(), cpu_s(), compilation_s()
    return lambda: {"cpu_s": cpu_s() - cpu, "compilation_cpu_s": compilation_s() - compiling,
                    "wall_s": time.perf_counter() - wall, "peak_MB": peak_MB()}


def peak_MB() -> float:
    """Most memory that this process has held so far, MB; the system counts in kB, on macOS in bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1e-6 if sys.platform == "darwin" else 1e-3)
