"""The figure of the current through a touched layer."""

import json

import numpy as np
import pytest

import eitsim
import matcal
from eitsim.scene.edges.disc import Disc
from reports.touch import layer_figure


@pytest.fixture(scope="module")
def result() -> dict:
    card = matcal.MaterialCard("rubber", matcal.Hyperfoam([1e5], [2.0], [0.4]),
                               conductivity=matcal.Conductivity(5.0, [-2.0, 2.0, -1.0], (-0.3, 1.0)))
    punch = eitsim.Punch(0.005, 0.0, 0.008, depth_m=5e-4, profile="sphere")
    scene = eitsim.Scene(eitsim.Body(Disc(0.04), 0.003), (punch,),
                         eitsim.Skin(0.003, "volume", "layer"), eitsim.Electrodes(count=8, soft=True),
                         accuracy=eitsim.Accuracy(0.3))
    return json.loads(json.dumps(eitsim.result_document(eitsim.simulate(scene, card), scene, card)))


def test_lines_are_tenths_and_the_caption_says_where_the_layer_is_a_sheet(result: dict) -> None:
    (block,) = result["layer"]
    figure = layer_figure.layer(block, result["profile"][0], 3.0, 0, 1)
    table = figure.data["layer"]
    heights = table[[f"z_{k}0_percent_mm" for k in range(1, 10)]].to_numpy()
    assert np.all(np.diff(heights, axis=1) > 0)
    np.testing.assert_allclose(heights[-1], np.linspace(-3, 0, 11)[1:-1], atol=0.03)
    uneven = table["potential_range"] > 0.01
    assert table["radius_mm"][uneven].max() == pytest.approx(block["sheet_from_mm"])
    assert "it is less than 1 %" in figure.caption
