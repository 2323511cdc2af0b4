"""A sphere pressed into axisymmetric foam with FElupe, in an interpreter that has it: `python felupe_sphere.py FOLDER`.

FOLDER/problem.npz holds the mesh (mm, bilinear) and the numbers, FOLDER/found.npz receives the path. FElupe has rigid
planes and circles, frictionless or Coulomb, by a penalty at nodes; a circle about the axis is a sphere, a filleted flat
punch is none of these. Its foam needs beta > 0.
"""

import sys
import time
from pathlib import Path

import felupe
import felupe.constitution.tensortrax as materials
import numpy as np


def main(folder: Path) -> None:
    given = np.load(folder / "problem.npz")
    place, centre = given["nodes"][:, ::-1], len(given["nodes"])
    mesh = felupe.Mesh(np.vstack([place, [[given["radius"], 0.0]]]), given["cells"][:, [0, 3, 2, 1]], "quad")
    field = felupe.FieldContainer([felupe.FieldAxisymmetric(felupe.RegionQuad(mesh), dim=2)])
    law = materials.Hyperelastic(materials.models.hyperelastic.storakers, mu=list(given["mu"]),
                                 alpha=list(given["alpha"]), beta=[float(given["beta"])] * len(given["mu"]))
    punch = felupe.ContactRigidCylinder(field, points=given["top"], centerpoint=centre, radius=float(given["radius"]),
                                        multiplier=float(given["penalty"]))
    of_centre = np.arange(len(mesh.points)) == centre
    fixed = {"bottom": felupe.Boundary(field[0], fx=float(place[:, 0].min())),
             "axis": felupe.Boundary(field[0], fy=0.0, skip=(True, False)),
             "centre": felupe.Boundary(field[0], mask=of_centre, skip=(True, False)),
             "punch": felupe.Boundary(field[0], mask=of_centre, skip=(False, True))}
    items, begun, force, moved = [felupe.SolidBody(law, field), punch], time.process_time(), [], []
    step = felupe.Step(items=items, ramp={fixed["punch"]: -given["depths"]}, boundaries=fixed)

    def record(_step: int, _number: int, substep: felupe.tools.NewtonResult) -> None:
        force.append(felupe.tools.force(substep.x, substep.fun, fixed["bottom"])[0])
        moved.append(substep.x[0].values[given["surface"]][:, ::-1].copy())

    felupe.Job(steps=[step], callback=record).evaluate(verbose=False, tol=1e-6)
    np.savez(folder / "found.npz", force=np.abs(force), surface=moved, cpu_s=time.process_time() - begun,
             version=felupe.__version__)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
