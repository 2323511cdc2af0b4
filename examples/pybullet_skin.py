"""Readings of a skin that lies on a body of PyBullet: its contact points go to `surrogate.Skin`.

Run it where PyBullet is installed (pip install pybullet), with a model of the method forward:

    python examples/pybullet_skin.py model
"""

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

MOST = 4  # contacts of a frame; those that are missing have no force
OTHER, ON_SKIN, NORMAL_FORCE = 2, 5, 9  # places in a tuple of getContactPoints(bodyA=skin)


def contacts_of(points: Sequence[Sequence[Any]], origin_m: Sequence[float], axes: Sequence[float],
                diameters_m: dict[int, float]) -> np.ndarray:
    """(MOST, 4) x_m, y_m, d_m, F_N by the tuples of getContactPoints, heaviest first: points of one body count as one
    contact at their centre of force.

    origin_m, axes: (3,) and (9,) place and rotation matrix of the skin, whose z axis leaves it; diameters_m: body that
    presses -> its diameter.
    """
    rotation = np.reshape(axes, (3, 3))
    found = []
    for other in {point[OTHER] for point in points}:
        own = [point for point in points if point[OTHER] == other]
        force = np.array([point[NORMAL_FORCE] for point in own])
        if force.sum() > 0:
            place = force @ np.array([point[ON_SKIN] for point in own]) / force.sum()
            x, y, _ = rotation.T @ (place - np.asarray(origin_m))
            found.append([x, y, diameters_m[other], force.sum()])
    found = sorted(found, key=lambda one: -one[3])[:MOST] + [[0.0, 0.0, 0.01, 0.0]] * (MOST - len(found))
    return np.array(found[:MOST])


def main(model_folder: str) -> None:
    """Drop a tip on the skin and print the largest change of a reading as it comes to rest."""
    import pybullet as p  # pyright: ignore[reportMissingImports]
    import torch

    import surrogate

    sensor = surrogate.Skin(model_folder, noise_V=1e-4)
    p.connect(p.DIRECT)
    p.setGravity(0, 0, -9.81)
    skin = p.createMultiBody(0, p.createCollisionShape(p.GEOM_CYLINDER, radius=0.1, height=0.01))
    tip = p.createMultiBody(0.08, p.createCollisionShape(p.GEOM_SPHERE, radius=0.006), basePosition=[0.02, 0.01, 0.012])
    for step in range(240):
        p.stepSimulation()
        if step % 24 == 23:
            origin, turn = p.getBasePositionAndOrientation(skin)
            points = p.getContactPoints(bodyA=skin)
            found = contacts_of(points, origin, p.getMatrixFromQuaternion(turn), {tip: 0.012})
            volts = sensor(torch.tensor(found[None], dtype=torch.float32))
            change = float((volts[0] - sensor.untouched_V).abs().max())
            print(f"{1e3 * (step + 1) / 240:4.0f} ms  {found[0, 3]:5.2f} N  largest change {1e3 * change:6.2f} mV")


if __name__ == "__main__":
    main(sys.argv[1])
