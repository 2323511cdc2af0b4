"""What electrodes cover: stretches of the edge, or closed outlines on the surface."""

import numpy as np

from eitsim.scene.edges.edge import Edge
from eitsim.scene.edges.outline_electrodes import patch_loops
from eitsim.scene.electrodes import Electrodes, lengths
from touchcal.arrays import Array


def outlines_m(edge: Edge, electrodes: Electrodes) -> list[Array]:
    """Points (n, 2), m, of each: along the edge of lines, about patches, the first one again at the end."""
    if loops := patch_loops(electrodes):
        return [np.vstack([loop, loop[:1]]) for loop in loops]
    paths = [edge.path_m(*stretch) for stretch in edge.stretches_m(electrodes).tolist()]
    if electrodes.along_edge:
        return paths
    inner = 1 - lengths(electrodes) / edge.size_m
    return [np.vstack([path, path[::-1] * share, path[:1]]) for path, share in zip(paths, inner.tolist(), strict=True)]
