"""Which curved triangles fold over: told by their Jacobians' Bezier coefficients as by points all over them."""

import numpy as np
from skfem import ElementTriP2

from eitsim.electrics.cem.assembly import SkinMesh
from eitsim.electrics.mesh.p2_triangles import straight, untangled


def loose(count: int) -> SkinMesh:
    """Triangles that share no node, with bent edges; both orders of corners."""
    rng = np.random.default_rng(6)
    corners = np.array([[0.0, 0], [1, 0], [0, 1]]) + 0.2 * rng.normal(size=(count, 3, 2))
    corners[::2] = corners[::2, ::-1]
    middle = (corners[:, [0, 1, 0]] + corners[:, [1, 2, 2]]) / 2 + 0.15 * rng.normal(size=(count, 3, 2))
    cells = np.arange(6 * count).reshape(-1, 6)
    return SkinMesh(np.concatenate([corners, middle], axis=1).reshape(-1, 2), cells, cells[:1, [0, 1, 3]],
                    np.zeros(1, int), 1, "P2")


def least_jacobian(mesh: SkinMesh, per_side: int) -> np.ndarray:
    """Least Jacobian (cells,) at points all over each triangle, positive where its corners' is."""
    i, j = np.triu_indices(per_side)
    points = np.stack([i, per_side - 1 - j]) / (per_side - 1)
    slopes = np.stack([np.broadcast_to(ElementTriP2().lbasis(points, k)[1], points.shape) for k in range(6)])
    jacobian = np.linalg.det(np.einsum("ekx,kdp->epxd", mesh.nodes_m[mesh.cells], slopes))
    corners = mesh.nodes_m[mesh.cells[:, :3]]
    return (jacobian * np.sign(np.linalg.det(corners[:, 1:] - corners[:, :1]))[:, None]).min(axis=1)


def test_a_triangle_is_straightened_where_it_folds_over():
    mesh = loose(2000)
    straightened = np.any((untangled(mesh, straight(mesh)).nodes_m != mesh.nodes_m).reshape(-1, 12), axis=1)
    least = least_jacobian(mesh, 49)
    assert 0.2 < np.mean(straightened) < 0.8
    assert not straightened[least > 0].any()
    assert straightened[least_jacobian(mesh, 9) < -0.15].all()
