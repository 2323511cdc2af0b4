"""Compiled kernels: a touch without compilation is the touch with it."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np

SOLVE = """
import json
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.scene import Body, Punch
from eitsim.mechanics.solid.axisymmetric_assembly import assemble
from matcal.laws.hyperfoam import Hyperfoam
law = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
touch = solve_touch(law, Body(), Punch(force_N=0.5), element_m=0.8e-3)
print(json.dumps({"compiled": hasattr(assemble, "py_func"), "depth": touch.depth_m, "moved": list(touch.u_z_m)}))
"""


def touched(**environment):
    done = subprocess.run([sys.executable, "-c", SOLVE], capture_output=True, text=True, check=True,
                          env={**os.environ, **environment})
    return json.loads(done.stdout)


def test_a_touch_without_compilation_is_the_touch_with_it():
    fast, plain = touched(NUMBA_DISABLE_JIT="0"), touched(NUMBA_DISABLE_JIT="1")
    assert fast["compiled"]
    assert not plain["compiled"]
    assert abs(plain["depth"] / fast["depth"] - 1) < 1e-10
    assert np.allclose(plain["moved"], fast["moved"], rtol=0, atol=1e-10 * fast["depth"])
