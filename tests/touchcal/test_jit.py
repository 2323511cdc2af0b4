"""Compiled loops kept on disk: they are used again, and compiled again once a function that they call has changed."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from touchcal.jit import compilable, compilation_s, compiled, cpu_s, where

LAW = "def stress(x):\n    return {} * x\n"
INNER = "from touchcal.jit import compiled\n\n@compiled\ndef shifted(x):\n    return x + {}\n"
LOOP = """
from law import stress
from inner import shifted
from other import halved
from touchcal.jit import compilable, compiled

compilable(stress)

@compiled
def total(x):
    out = 0.0
    for k in range(x.size):
        out += shifted(stress(x[k]))
    return out
"""
OTHER = "def halved(x):\n    return x / 2\n"
FIRST = "import other, touchcal.jit; touchcal.jit.compilable(other.halved); "
CALL = "import numpy, loop; print(loop.total(numpy.ones(3)), sum(loop.total.stats.cache_hits.values()))"


def called(folder: Path, first: str = "") -> list[float]:
    words = [sys.executable, "-c", first + CALL]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True, env={
        **os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(Path(__file__).parents[2])]),
        "NUMBA_DISABLE_JIT": "0"})
    return [float(word) for word in done.stdout.split()]


@pytest.mark.thorough
def test_a_loop_is_compiled_again_when_what_it_calls_has_changed(tmp_path: Path) -> None:
    """The files changed have the same length: neither the loop's own file nor a size tells."""
    (tmp_path / "law.py").write_text(LAW.format(2))
    (tmp_path / "inner.py").write_text(INNER.format(0))
    (tmp_path / "loop.py").write_text(LOOP)
    (tmp_path / "other.py").write_text(OTHER)
    assert called(tmp_path) == [6.0, 0]
    assert called(tmp_path) == [6.0, 1]
    assert called(tmp_path, FIRST) == [6.0, 1]  # whatever else was made ready for loops before
    (tmp_path / "law.py").write_text(LAW.format(5))
    assert called(tmp_path) == [15.0, 0]
    (tmp_path / "inner.py").write_text(INNER.format(1))
    assert called(tmp_path) == [18.0, 0]
    assert called(tmp_path) == [18.0, 1]


def clipped(x):
    return where(x < 0, 0.0, x)


@compiled
def clip(x, out):
    for k in range(x.size):
        out[k] = clipped(x[k])


def test_one_function_serves_arrays_and_loops() -> None:
    compilable(clipped)
    x, out = np.array([-1.0, 0.0, 2.5]), np.empty(3)
    clip(x, out)
    assert out.tolist() == clipped(x).tolist() == [0.0, 0.0, 2.5]


def test_compilation_does_without_a_place_for_its_cache() -> None:
    scope: dict = {}
    exec("def twice(x):\n    return 2 * x\n", scope)  # no file, hence no cache
    assert compiled(scope["twice"])(3.0) == pytest.approx(6.0)


def test_compilation_is_no_cost_of_what_is_computed() -> None:
    scope: dict = {"compiled": compiled}
    exec("inner = compiled(lambda x: x + 1)\n@compiled\ndef outer(x):\n    return inner(2 * x)\n", scope)
    before, whole, own = compilation_s(), time.process_time(), cpu_s()
    scope["outer"](3.0)
    whole, own, compiling = time.process_time() - whole, cpu_s() - own, compilation_s() - before
    assert own < 0.5 * whole
    assert compiling + own == pytest.approx(whole, abs=1e-3)
    scope["outer"](4.0)
    assert compilation_s() - before == compiling
