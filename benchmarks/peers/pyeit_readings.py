"""Readings of point electrodes by pyEIT, in an interpreter that has it: `python pyeit_readings.py FOLDER`.

FOLDER/problem.npz holds nodes (m), elements, electrode (the node of each) and conductivity (elements, cases);
FOLDER/found.npz receives the readings of the adjacent patterns, the electrodes driven (patterns, 2) and read (patterns,
readings, 2), the CPU seconds of each case and the version. pyEIT has no complete electrode model: its readings are
those of another one.
"""

import importlib.metadata
import sys
import time
from pathlib import Path

import numpy as np
from pyeit.eit import protocol
from pyeit.eit.fem import EITForward
from pyeit.mesh import PyEITMesh


def main(folder: Path) -> None:
    given = np.load(folder / "problem.npz")
    mesh = PyEITMesh(node=given["nodes"], element=given["elements"], perm=np.ones(len(given["elements"])),
                     el_pos=given["electrode"], ref_node=0)
    patterns = protocol.create(len(given["electrode"]), dist_exc=1, step_meas=1, parser_meas="std")
    forward = EITForward(mesh, patterns)
    readings, seconds = [], []
    for case in given["conductivity"].T:
        begun = time.process_time()
        readings.append(forward.solve_eit(case))
        seconds.append(time.process_time() - begun)
    np.savez(folder / "found.npz", readings=np.array(readings).T, seconds=seconds, driven=patterns.ex_mat,
             read=patterns.meas_mat, version=f"pyEIT {importlib.metadata.version('pyeit')}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
