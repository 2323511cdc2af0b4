"""A skin seen from above: the same from a scene and from a surrogate, electrodes around corners and on the surface."""

import numpy as np
import pytest

from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import Body, Electrodes, Scene
from surrogate.data.sensor_ring import Ring
from surrogate.data.skin_from_above import skin_of, skin_of_sheet


def test_a_surrogate_s_skin_is_that_of_its_scene(rectangle: Scene, rectangle_ring: Ring) -> None:
    assert rectangle_ring.sheet is not None
    found, known = skin_of_sheet(rectangle_ring.sheet), skin_of(rectangle.body.outline, rectangle.electrodes)
    assert len(found.electrodes_mm) == 16
    for some, others in ((found.loops_mm, known.loops_mm), (found.electrodes_mm, known.electrodes_mm)):
        for one, other in zip(some, others, strict=True):
            assert one == pytest.approx(other, abs=1e-9)


def test_an_electrode_goes_around_a_corner() -> None:
    body = Body(Outline("rectangle", width_m=0.04, height_m=0.02))
    skin = skin_of(body.outline, Electrodes(count=4, width_m=0.006, positions_m=(0.0, 0.009, 0.03, 0.05)))
    assert skin.electrodes_mm[1] == pytest.approx(np.array([[20, 6], [20, 10], [18, 10]]), abs=1e-9)
    for one in skin.electrodes_mm:
        assert np.linalg.norm(np.diff(one, axis=0), axis=1).sum() == pytest.approx(6.0)


def test_holes_and_patches_are_closed_loops() -> None:
    body = Body(Outline("rectangle", width_m=0.12, height_m=0.08, holes_m=((0.0, 0.0, 0.005),)))
    skin = skin_of(body.outline, Electrodes(kind="surface", count=4, x_m=(-0.04, -0.02, 0.02, 0.04), y_m=(0.02,) * 4,
                                          width_m=0.004))
    assert len(skin.loops_mm) == 2
    for one in skin.electrodes_mm:
        assert np.array_equal(one[0], one[-1])
    assert skin.electrodes_mm[2][:-1].mean(axis=0) == pytest.approx([20, 20])
