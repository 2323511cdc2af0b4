"""Own code against a library that does the same work: the figures of docs/decisions.md.

Run as `python benchmarks/alternatives.py [pools] [gaussian] [correlation]`, by default all; libraries that are not
installed are left out: pebble, scikit-learn.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from functools import partial
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from touchcal.parallel.pool import answers
from touchcal.parallel.processes import processes

ITEMS, WORKERS, TRIES = 200, 2, 3
# Items that kill their worker at the first try, and the one that kills every worker.
ONCE, ALWAYS = (20, 90, 150), 60


def quick(item: int) -> int:
    return 2 * item


def deadly(folder: str, item: int) -> int:
    tries = len(list(Path(folder).glob(f"{item}-*")))
    Path(folder, f"{item}-{tries}").touch()
    if item == ALWAYS or (item in ONCE and not tries):
        os.kill(os.getpid(), 9)
    return 2 * item


def touchcal(task: Callable[[int], int], items: Iterable[int]) -> Iterator[tuple[int, object]]:
    with processes(WORKERS) as crew:
        yield from answers(crew, task, items, TRIES)


def pebble(task: Callable[[int], int], items: Iterable[int]) -> Iterator[tuple[int, object]]:
    from pebble import ProcessExpired, ProcessPool

    ahead, again, out = ((item, 0) for item in items), [], {}
    with ProcessPool(WORKERS, context=get_context("spawn")) as pool:
        while True:
            while len(out) < 2 * WORKERS and (taken := again.pop() if again else next(ahead, None)):
                out[pool.schedule(task, args=[taken[0]])] = taken
            if not out:
                return
            for future in wait(out, return_when=FIRST_COMPLETED).done:
                item, lost = out.pop(future)
                error = future.exception()
                if isinstance(error, ProcessExpired) and lost + 1 < TRIES:
                    again.append((item, lost + 1))
                else:
                    yield item, error or future.result()


def pools() -> None:
    for run in (touchcal, pebble):
        for task in (quick, partial(deadly, folder := tempfile.mkdtemp())) if find_spec(run.__name__) else ():
            begun, times, right = time.perf_counter(), [], 0
            for item, found in run(task, range(ITEMS)):
                times.append(time.perf_counter() - begun)
                right += isinstance(found, int) and found == 2 * item
            print(f"{run.__name__}: first answer {times[0]:.2f} s, last {times[-1]:.2f} s; {right} of {ITEMS} right, "
                  f"{len(list(Path(folder).iterdir()))} tries of deadly items", flush=True)


def gaussian() -> None:
    if not find_spec("sklearn"):
        return
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    from surrogate.statistics import gaussian_process

    at, rng = np.random.default_rng(2).random((1000, 3)), np.random.default_rng(0)
    for n, noise in ((140, 1e-4), (140, 0.1), (800, 1e-4), (800, 0.1)):
        x = rng.random((n, 3))
        y, truth = (np.sin(3 * z[:, 0]) + 4 * z[:, 1] ** 2 + z[:, 2] for z in (x, at))
        y = y + noise * rng.normal(size=n)
        begun = time.process_time()
        own = gaussian_process.mean(gaussian_process.fit(x, y), at)[0]
        between, trend = time.process_time(), np.linalg.lstsq(np.column_stack([np.ones(n), x]), y, rcond=None)[0]
        left = y - trend[0] - x @ trend[1:]
        kernel = ConstantKernel(1.0, (1e-3, 1e6)) * RBF(np.full(3, 2.0), (0.2, 100)) + WhiteKernel(1e-2, (1e-10, 10))
        theirs = GaussianProcessRegressor(kernel, n_restarts_optimizer=1, random_state=0)
        other = theirs.fit(x / 0.3, left / left.std()).predict(at / 0.3) * left.std() + trend[0] + at @ trend[1:]
        print(f"{n} rows, noise {noise:g}: RMS error, CPU s: ours {np.std(own - truth):.3g}, {between - begun:.2f}; "
              f"scikit-learn {np.std(other - truth):.3g}, {time.process_time() - between:.2f}", flush=True)


def correlation() -> None:
    from emcee.autocorr import integrated_time

    from matcal.statistics.residual_correlation import inflation

    for n, length in ((30, 1), (30, 19), (200, 1), (200, 19), (2000, 19)):
        steps, slow = np.random.default_rng(0).normal(size=(100, n + 200)), (length - 1) / (length + 1)
        series = np.array([np.convolve(row, slow ** np.arange(200.0))[200:n + 200] for row in steps])
        own = [inflation(row) for row in series]
        theirs = [float(integrated_time(row, tol=0)[0]) for row in series]
        print(f"{n} residuals, correlation time {length}: ours {np.mean(own):.2f}, emcee {np.mean(theirs):.2f}, "
              f"below 1 in {sum(t < 1 for t in theirs)} of 100")


if __name__ == "__main__":
    known = {"pools": pools, "gaussian": gaussian, "correlation": correlation}
    for word in sys.argv[1:] or known:
        if word not in known:
            raise SystemExit(f"alternatives.py: '{word}' is unknown; known: {', '.join(known)}.")
        known[word]()
