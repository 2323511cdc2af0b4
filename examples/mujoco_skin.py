"""Readings of a skin that lies on a geom of MuJoCo: its contacts, in the skin's own axes, go to `surrogate.Skin`.

Run it where MuJoCo is installed (pip install mujoco), with a model of the method forward:

    python examples/mujoco_skin.py model
"""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

MOST = 4  # contacts of a frame; those that are missing have no force


def contacts_of(data: Any, geom: int, diameters_m: dict[int, float],
                force_of: Callable[[int], np.ndarray]) -> np.ndarray:
    """(MOST, 4) x_m, y_m, d_m, F_N on a geom whose z axis leaves the skin, heaviest first: points of one body count as
    one contact at their centre of force.

    diameters_m: geom that presses -> its diameter; force_of: number of a contact -> its force, normal first.
    """
    axes, origin = np.reshape(data.geom_xmat[geom], (3, 3)), np.asarray(data.geom_xpos[geom])
    pressing: dict[int, list[tuple[float, np.ndarray]]] = {}
    for i, contact in enumerate(data.contact[:data.ncon]):
        if geom in (pair := (int(contact.geom1), int(contact.geom2))):
            place = axes.T @ (np.asarray(contact.pos) - origin)
            pressing.setdefault(pair[0] if pair[1] == geom else pair[1], []).append((float(force_of(i)[0]), place))
    found = []
    for other, points in pressing.items():
        force = np.array([one for one, _ in points])
        if force.sum() > 0:
            x, y, _ = force @ np.array([place for _, place in points]) / force.sum()
            found.append([x, y, diameters_m[other], force.sum()])
    found = sorted(found, key=lambda one: -one[3])[:MOST] + [[0.0, 0.0, 0.01, 0.0]] * (MOST - len(found))
    return np.array(found[:MOST])


SCENE = """<mujoco>
  <worldbody>
    <geom name="skin" type="cylinder" size="0.1 0.005"/>
    <body pos="0.02 0.01 0.012">
      <freejoint/>
      <geom name="tip" type="sphere" size="0.006" mass="0.08"/>
    </body>
  </worldbody>
</mujoco>"""


def main(model_folder: str) -> None:
    """Drop a tip on the skin and print the largest change of a reading as it comes to rest."""
    import mujoco  # pyright: ignore[reportMissingImports]
    import torch

    import surrogate

    skin = surrogate.Skin(model_folder, noise_V=1e-4)
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    geom, tip = model.geom("skin").id, model.geom("tip").id

    def force_of(i: int) -> np.ndarray:
        force = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, force)
        return force

    for step in range(500):
        mujoco.mj_step(model, data)
        if step % 50 == 49:
            found = contacts_of(data, geom, {tip: 0.012}, force_of)
            volts = skin(torch.tensor(found[None], dtype=torch.float32))
            change = float((volts[0] - skin.untouched_V).abs().max())
            print(f"{1e3 * data.time:4.0f} ms  {found[0, 3]:5.2f} N  largest change {1e3 * change:6.2f} mV")


if __name__ == "__main__":
    main(sys.argv[1])
