"""Places as the nearest edge sees them, on a disc and on a rectangle."""

import numpy as np
import pytest

from surrogate.data.edge_frame import edge_frame
from surrogate.data.sensor_ring import Ring, place

H = 1e-6


def test_directions_are_slopes_of_how_near_the_edge_is(ring: Ring, rectangle_ring: Ring) -> None:
    """`radial` grows along `outwards`, by 1, and that direction turns as `turn` says."""
    for skin, mm in ((ring, [[30.0, -50.0], [80.0, 10.0]]), (rectangle_ring, [[10.0, 40.0], [-65.0, 3.0]])):
        z = place(skin, np.array(mm))
        here = edge_frame(skin, z)
        for k, way in enumerate((1.0, 1j)):
            after, before = edge_frame(skin, z + H * way), edge_frame(skin, z - H * way)
            slope = (after.radial - before.radial) / (2 * H)
            assert slope == pytest.approx([here.outwards.real, here.outwards.imag][k], abs=1e-6)
            assert np.angle(after.outwards / before.outwards) / (2 * H) == pytest.approx(here.turn[:, k], abs=1e-6)
