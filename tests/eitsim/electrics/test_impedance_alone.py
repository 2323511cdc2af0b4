"""The impedance matrix from an elimination that keeps no front but the root."""

import numpy as np

from eitsim.electrics.cem.assembly import centred, impedance, potentials
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.scene.scene import Body, Electrodes


def test_fronts_that_are_not_kept_leave_the_same_impedance():
    angles, electrode = rim_angles(Body(), Electrodes())
    mesh = ring_mesh(np.linspace(0, 0.1, 12), np.zeros((12, 2)), angles, electrode, Electrodes().count)
    conductance = np.random.default_rng(0).uniform(0.5, 2, len(mesh.cells))
    kept = centred(mesh, potentials(mesh, conductance, 1e-3))[len(mesh.nodes_m):]
    np.testing.assert_allclose(impedance(mesh, conductance, 1e-3), kept, rtol=1e-12)
