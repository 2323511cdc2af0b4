"""The sensor from above where its skin has an outline."""

import numpy as np
import pytest
from matplotlib.patches import Polygon

from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import Body, Electrodes, Punch, Scene, scene_tables
from reports.touch.touch_figures import scene

BODY = Body(Outline("rectangle", width_m=0.12, height_m=0.08, holes_m=((-0.04, 0.0, 0.004),)))
GRID = Electrodes(kind="surface", count=6, x_m=(-0.02, 0, 0.02) * 2, y_m=(-0.02,) * 3 + (0.02,) * 3, width_m=0.01)


@pytest.mark.parametrize("electrodes", [Electrodes(count=9, width_m=0.02, missing=(2,)), GRID])
def test_outline_hole_and_electrodes_are_drawn_to_scale(electrodes):
    drawn = scene(scene_tables(Scene(BODY, (Punch(0.01, 0.005),), electrodes=electrodes)))
    (axes,) = drawn.figure.axes
    outer, hole, *patches = [np.array(one.get_xy()) for one in axes.patches if isinstance(one, Polygon)]
    np.testing.assert_allclose(np.ptp(outer, axis=0), [120, 80])
    np.testing.assert_allclose(np.ptp(hole, axis=0), [8, 8], rtol=1e-2)
    if electrodes.kind == "surface":
        assert len(patches) == 6
    else:
        drawn_lines = [np.column_stack(line.get_data()) for line in axes.lines]
        lengths = [np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in drawn_lines]
        np.testing.assert_allclose(lengths, 20, rtol=1e-9)
    assert {text.get_text() for text in axes.texts} >= {str(k) for k in range(electrodes.count)}
    assert "its edge is 28.0 mm from the nearest edge of the skin" in drawn.caption
