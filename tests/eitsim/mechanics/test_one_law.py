"""The law is written once: a law of twice the energy, put into a copy of the packages, is felt by the fit, the
axisymmetric touch and the touch near the rim, to the last digits."""

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[3]
LAW = Path("matcal", "laws", "hyperfoam.py")
# Functions of one term that are proportional to its modulus.
TERMS = ("energy_term", "kirchhoff_term", "stretch_tangent_term", "volume_tangent_term", "divided_difference_term")
# All that is not the foam's own stiffness grows with `factor`: the force, the penalty and the tie outside the rim.
SOLVE = """
import json, sys
import numpy as np
from eitsim.mechanics.axisymmetric.solve_axisymmetric import force_unit, mesh_hierarchy, under_force
from eitsim.mechanics.harmonics import clipped_disc
from eitsim.mechanics.harmonics.arcs import OffsetDisc
from eitsim.mechanics.harmonics.equilibrium import solve
from eitsim.scene.profiles.rounded_cone import Flat
from eitsim.scene.scene import Body, Punch
from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.hyperfoam.hyperfoam_fit import fit
from matcal.laws.hyperfoam import Hyperfoam
from matcal.reduction.experiment import Experiment

factor = float(sys.argv[1])
law = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.1, 0.2, 0.1])
levels = mesh_hierarchy(law, Body(), Punch(), 8e-4, factor * Flat.default_penalty)
state = under_force(levels, factor * 0.5 / force_unit(law, Body()))[-1]
clipped_disc.TIE *= factor
disc = clipped_disc.clipped_disc(levels[-1], state, OffsetDisc(10.0, 9.1), 4, 9, 4.0)
rim = solve(disc)
strain = np.linspace(-0.6, -0.02, 30)
fitted = fit(weigh([Experiment("uniaxial", strain, 2e4 * strain * (1 + strain**2), source=("curve",))]), 1).law
print(json.dumps({"axis": [state.depth, *state.x], "axis_steps": state.residuals, "rim": list(rim.x),
                  "rim_steps": rim.residuals, "mu": (factor * fitted.mu_Pa).tolist(), "alpha": fitted.alpha.tolist()}))
"""


class Doubled(ast.NodeTransformer):
    """Doubles what the functions of a term return."""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        if node.name in TERMS:
            for part in ast.walk(node):
                if isinstance(part, ast.Return) and part.value is not None:
                    part.value = ast.BinOp(ast.Constant(2), ast.Mult(), part.value)
        return node


def solved(root: Path, factor: float) -> dict[str, np.ndarray]:
    done = subprocess.run([sys.executable, "-c", SOLVE, str(factor)], cwd=root, capture_output=True, text=True,
                          check=True, env={**os.environ, "PYTHONPATH": str(root), "NUMBA_DISABLE_JIT": "0"})
    return {name: np.array(value) for name, value in json.loads(done.stdout).items()}


@pytest.mark.slow
def test_a_law_of_twice_the_energy_is_felt_by_fit_axis_and_rim(tmp_path: Path) -> None:
    for package in ("touchcal", "matcal", "eitsim"):
        shutil.copytree(ROOT / package, tmp_path / package)  # with the loops that have been compiled
    source = ast.parse((tmp_path / LAW).read_text(encoding="utf-8"))
    assert set(TERMS) <= {node.name for node in source.body if isinstance(node, ast.FunctionDef)}
    (tmp_path / LAW).write_text(ast.unparse(ast.fix_missing_locations(Doubled().visit(source))), encoding="utf-8")
    once, twice = solved(ROOT, 1.0), solved(tmp_path, 2.0)
    for name in ("axis", "rim", "mu", "alpha"):
        assert np.allclose(twice[name], once[name], rtol=0, atol=1e-12 * np.abs(once[name]).max()), name
    for name in ("axis_steps", "rim_steps"):
        assert twice[name].shape == once[name].shape, name
