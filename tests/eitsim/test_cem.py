"""The complete electrode model on given meshes: parity with EIDORS, convergence, balance, stiff cases."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eitsim.cem import SkinMesh, impedance
from eitsim.drive import read_out
from eitsim.scene import Drive

REFERENCE = Path(__file__).parents[2].parent / "shared" / "reference" / "eit"
needs_reference = pytest.mark.skipif(not REFERENCE.exists(), reason="the reference meshes are not beside the checkout")
CASES = {"homog": (1e-3, 1e-3), "concentric": (1e-3, 4e-3)}


def reference_mesh(name: str) -> tuple[SkinMesh, np.ndarray]:
    file = np.load(REFERENCE / f"mesh_{name}.npz")
    under = file["belec"] > 0
    mesh = SkinMesh(file["nodes"], file["elems"], file["bedges"][under], file["belec"][under] - 1, 16)
    return mesh, file["region"]


def readings_of(name: str, case: str) -> np.ndarray:
    mesh, region = reference_mesh(name)
    outside, inside = CASES[case]
    return read_out(Drive(), impedance(mesh, np.where(region == 1, outside, inside), 1.0))


@needs_reference
@pytest.mark.parametrize("name", ["r1", "r2"])
@pytest.mark.parametrize("case", CASES)
def test_parity_with_eidors_on_the_same_mesh(name, case):
    expected = np.loadtxt(REFERENCE / f"eidors_{case}_{name}_single.csv", delimiter=",")
    assert np.abs(readings_of(name, case) / expected - 1).max() < 1e-12
