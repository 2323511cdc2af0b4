"""Own code against a library that does the same work: the figures of docs/decisions.md.

Run as `python benchmarks/alternatives.py [pools] [gaussian] [matern] [correlation] [squares]`, by default all; writes
results/alternatives.csv, where other trials keep their rows. Libraries that are not installed are left out: pebble,
scikit-learn.
"""

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from functools import partial
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written

from touchcal.parallel.pool import answers
from touchcal.parallel.processes import processes

ITEMS, WORKERS, TRIES = 200, 2, 3
# Items that kill their worker at the first try, and the one that kills every worker.
ONCE, ALWAYS = (20, 90, 150), 60
HEAVY_MB = 20
Row = dict[str, object]


def double(item: int) -> int:
    return 2 * item


def double_with(table: np.ndarray, item: int) -> int:
    return 2 * item + int(table[0])


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
    from pebble import ProcessExpired, ProcessPool  # pyright: ignore[reportMissingImports]

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


def pools() -> Iterator[Row]:
    """Times by the clock, of 200 items: of some that kill their worker, of some that do nothing, and of some whose
    task holds a table."""
    for run in (touchcal, pebble):
        if not find_spec(run.__name__):
            continue
        table = np.zeros(HEAVY_MB * 125_000)
        with tempfile.TemporaryDirectory() as folder:
            for case, task in (("nothing", double), ("a table", partial(double_with, table)),
                               ("kills", partial(deadly, folder))):
                begun, times, right = time.perf_counter(), [], 0
                for item, found in run(task, range(ITEMS)):
                    times.append(time.perf_counter() - begun)
                    right += isinstance(found, int) and found == 2 * item
                yield {"case": case, "by": run.__name__, "right": right, "tries": len([*Path(folder).iterdir()]),
                       "first_s": times[0], "wall_s": times[-1], "ms_an_item": 1e3 * (times[-1] - times[0]) / ITEMS}


def gaussian() -> Iterator[Row]:
    """A process of one output: error of the mean at 1000 places, CPU time of fit and mean."""
    from surrogate.statistics import gaussian_process

    if find_spec("sklearn"):
        import_module("sklearn.gaussian_process")
    at, rng = np.random.default_rng(2).random((1000, 3)), np.random.default_rng(0)
    for n, noise in quick(((140, 1e-4), (140, 0.1), (800, 1e-4), (800, 0.1)), ((140, 0.1),)):
        x = rng.random((n, 3))
        y, truth = (np.sin(3 * z[:, 0]) + 4 * z[:, 1] ** 2 + z[:, 2] for z in (x, at))
        y = y + noise * rng.normal(size=n)
        case = {"rows": n, "noise": noise}
        begun = time.process_time()
        own = gaussian_process.predict(gaussian_process.fit(x, y), at)[0]
        yield {**case, "by": "touchcal", "error": np.std(own - truth), "cpu_s": time.process_time() - begun}
        if find_spec("sklearn"):
            begun = time.process_time()
            other = smooth_by_sklearn(x, y, at)
            yield {**case, "by": "scikit-learn", "error": np.std(other - truth), "cpu_s": time.process_time() - begun}


def smooth_by_sklearn(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The mean at other places: a process about a linear trend, restarted once."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # pyright: ignore[reportMissingImports]
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel  # pyright: ignore[reportMissingImports]

    trend = np.linalg.lstsq(np.column_stack([np.ones(len(x)), x]), y, rcond=None)[0]
    left = y - trend[0] - x @ trend[1:]
    kernel = ConstantKernel(1.0, (1e-3, 1e6)) * RBF(np.full(3, 2.0), (0.2, 100)) + WhiteKernel(1e-2, (1e-10, 10))
    process = GaussianProcessRegressor(kernel, n_restarts_optimizer=1, random_state=0).fit(x / 0.3, left / left.std())
    return process.predict(at / 0.3) * left.std() + trend[0] + at @ trend[1:]


def matern() -> Iterator[Row]:
    """A process of 8 outputs, sines of 3 inputs, 600 rows: r.m.s. error at 1000 places, CPU time of fit and mean."""
    from surrogate.statistics import matern_process

    rng = np.random.default_rng(0)
    x, at, waves = rng.random((quick(600, 100), 3)), rng.random((1000, 3)), rng.uniform(-3, 3, (3, 8))
    for noise in (0.0, 0.01):
        y, case = np.sin(x @ waves) + noise * rng.normal(size=(len(x), 8)), {"rows": len(x), "noise": noise}
        begun = time.process_time()
        own = matern_process.predict(matern_process.fit(x, y), at)[0]
        yield {**case, "by": "touchcal", "error": np.sqrt(np.mean((own - np.sin(at @ waves)) ** 2)),
               "cpu_s": time.process_time() - begun}
        if find_spec("sklearn"):
            from sklearn.gaussian_process import GaussianProcessRegressor  # pyright: ignore[reportMissingImports]
            from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel  # pyright: ignore[reportMissingImports]

            kernel = ConstantKernel(1.0, (1e-3, 1e6)) * Matern(np.ones(3), (0.03, 30), nu=2.5) + WhiteKernel(
                1e-4, (1e-10, 1))
            begun = time.process_time()
            other = GaussianProcessRegressor(kernel, random_state=0).fit(x, y).predict(at)
            yield {**case, "by": "scikit-learn", "error": np.sqrt(np.mean((other - np.sin(at @ waves)) ** 2)),
                   "cpu_s": time.process_time() - begun}


def correlation() -> Iterator[Row]:
    """Correlation time of series of a known one, over 100 of them: its mean, and how often it is below 1. No parameter
    was fitted to them."""
    from emcee.autocorr import integrated_time

    from matcal.statistics.residual_correlation import correlated_errors

    def own(row: np.ndarray) -> float:
        (errors,) = correlated_errors([row], [np.zeros((len(row), 1))], np.eye(1), [0.0])
        return errors.count / errors.effective_sample_size

    for n, length in ((30, 1), (30, 19), (200, 1), (200, 19), (2000, 19)):
        steps, slow = np.random.default_rng(0).normal(size=(100, n + 200)), (length - 1) / (length + 1)
        series = np.array([np.convolve(row, slow ** np.arange(200.0))[200:n + 200] for row in steps])
        for by, estimate in (("touchcal", own), ("emcee", partial(integrated_time, tol=0))):
            begun = time.process_time()
            found = [float(np.squeeze(estimate(row))) for row in series]
            yield {"rows": n, "true_time": length, "by": by, "mean_time": np.mean(found),
                   "below_1": sum(one < 1 for one in found), "ms_a_series": 10 * (time.process_time() - begun)}


def squares() -> Iterator[Row]:
    """400 fits of 3 parameters to 50 points each: CPU time, and half the squared residuals in all."""
    from scipy.optimize import least_squares

    from surrogate.statistics import levenberg_marquardt

    rng, at = np.random.default_rng(0), np.linspace(0, 1, 50)
    true = rng.uniform((0.5, 1.0, -1.0), (2.0, 4.0, 1.0), (400, 3))
    data = curves(true, at)[0] + 0.01 * rng.normal(size=(400, 50))
    start = np.tile([1.0, 2.0, 0.0], (400, 1))

    def residuals(state: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, jacobian = curves(state, at)
        return value - data[which], jacobian

    begun = time.process_time()
    cost = levenberg_marquardt.minimise(residuals, start, 100).cost.sum()
    yield {"rows": 400, "by": "touchcal", "error": cost, "cpu_s": time.process_time() - begun}
    begun = time.process_time()
    cost = sum(least_squares(lambda p, k=k: residuals(p[None], np.array([k]))[0][0], start[k], method="lm",
                             jac=lambda p: curves(p[None], at)[1][0]).cost for k in range(400))
    yield {"rows": 400, "by": "scipy", "error": cost, "cpu_s": time.process_time() - begun}


def curves(state: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """a exp(-b t) + c of states (n, 3), and its derivatives (n, t, 3)."""
    a, b, c = (column[:, None] for column in state.T)
    decay = np.exp(-b * at)
    return a * decay + c, np.stack([decay, -a * at * decay, np.ones_like(decay)], axis=2)


def main() -> None:
    known = {"pools": pools, "gaussian": gaussian, "matern": matern, "correlation": correlation, "squares": squares}
    if unknown := set(sys.argv[1:]) - set(known):
        raise SystemExit(f"alternatives.py: '{', '.join(unknown)}' is unknown; known: {', '.join(known)}.")
    asked = sys.argv[1:] or [*known]
    rows = pd.DataFrame([{"trial": name, **row, "version": version(str(row["by"]))} for name in asked
                         for row in known[name]()])
    table = earlier("alternatives")
    kept = table[~table["trial"].isin(asked)] if len(table) else table
    shown(written(pd.concat([kept, rows]), "alternatives"))


if __name__ == "__main__":
    main()
