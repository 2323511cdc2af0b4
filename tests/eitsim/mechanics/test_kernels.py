"""Compiled kernels: a touch without compilation is the touch with it."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

SOLVE = """
import json
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.scene import Body, Punch
from eitsim.mechanics.solid.meridian_response import _compose
from matcal.laws.hyperfoam import Hyperfoam
law = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
touch = solve_touch(law, Body(), Punch(force_N=0.5), element_m=0.8e-3)
print(json.dumps({"compiled": hasattr(_compose, "py_func"), "depth": touch.depth_m, "moved": list(touch.u_z_m)}))
"""

COMPILED = """
import json
import eitsim, matcal
from numba.core import event
met = []

class Met(event.Listener):
    def on_start(self, event):
        met.append(event.data["dispatcher"].py_func.__module__)

    def on_end(self, event):
        pass

event.register("numba:compile", Met())
foam = matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm")
card = matcal.MaterialCard("foam", foam, conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
for x_m in (0.0, 0.08):
    scene = eitsim.Scene(punches=[eitsim.Punch(x_m=x_m, force_N=0.2)], accuracy=eitsim.Accuracy(0.05))
    assert eitsim.simulate(scene, card).outcome == "ok"
print(json.dumps(met))
"""


def touched(**environment):
    done = subprocess.run([sys.executable, "-c", SOLVE], capture_output=True, text=True, check=True,
                          env={**os.environ, **environment})
    return json.loads(done.stdout)


@pytest.mark.slow
def test_a_touch_without_compilation_is_the_touch_with_it():
    fast, plain = touched(NUMBA_DISABLE_JIT="0"), touched(NUMBA_DISABLE_JIT="1")
    assert fast["compiled"]
    assert not plain["compiled"]
    assert abs(plain["depth"] / fast["depth"] - 1) < 1e-10
    assert np.allclose(plain["moved"], fast["moved"], rtol=0, atol=1e-10 * fast["depth"])


@pytest.mark.slow
def test_first_touches_compile_no_text(tmp_path):
    """Copying one slice onto another compiles what words the message of unequal shapes: a third of the time."""
    done = subprocess.run([sys.executable, "-c", COMPILED], capture_output=True, text=True, check=True,
                          env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)})
    met = json.loads(done.stdout)
    assert "eitsim.numerics.conductor_elimination" in met
    assert "eitsim.sheet.sheet_conductance" in met
    assert [module for module in met if "unicode" in module] == []
