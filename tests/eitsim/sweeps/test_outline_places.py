"""Places of touches on skins with an outline: inside, evenly, as far from edges as asked or as the plan solves."""

import numpy as np
import pytest

from eitsim.electrics.forward.gridded_fields import StoredFields, blank, inside, places
from eitsim.scene.polygons import area_m2, edge_distance_m
from eitsim.scene.scene import Body, scene_from
from eitsim.simulation.edge_effects import least_gap_m
from eitsim.sweeps.design.design import design_from, kept_from_edges, scene_at
from eitsim.sweeps.design.outline_places import on_outline

CORNERS = [[0, 0], [200, 0], [200, 80], [80, 80], [80, 200], [0, 200]]
BODY = {"outline": "polygon", "points_mm": CORNERS, "thickness_mm": 2, "holes_mm": [[40, 120, 6]]}
DESIGN = {"scenes": 200, "seed": 3, "body": BODY, "electrodes": {"count": 16},
          "punch": {"diameter_mm": [6, 12], "force_N": 0.2}}


def gaps_of(design: dict, rows: int = 200) -> np.ndarray:
    made = design_from(design)
    scenes = [scene_at(made, k) for k in range(rows)]
    return np.array([edge_distance_m(s.body.outline, (s.punches[0].x_m, s.punches[0].y_m)) - s.punches[0].diameter_m / 2
                     for s in scenes])


@pytest.mark.parametrize("sampler", ["random", "sobol"])
def test_places_keep_the_gap_that_is_asked_for(sampler):
    gaps = gaps_of(DESIGN | {"sampler": sampler, "punch": DESIGN["punch"] | {"place": {"gap_mm": 4}}})
    assert 0.004 <= gaps.min() < 0.006


@pytest.mark.thorough
def test_places_keep_the_gap_that_the_plan_solves_unless_one_is_given():
    keep = least_gap_m(scene_from({"body": BODY}))
    gaps = gaps_of(DESIGN, 100)
    assert keep <= gaps.min() < keep + 0.003
    rough = gaps_of(DESIGN | {"accuracy": {"signal": 0.1}}, 100)
    assert rough.min() < keep


def test_it_is_said_how_far_from_edges_touches_keep_unless_a_gap_or_places_are_given():
    """10 mm of a square of 40 mm with a punch of 2 mm: a square of 18 mm, less a square of 1/256 all around."""
    square = {"outline": "rectangle", "width_mm": 40, "height_mm": 40, "thickness_mm": 10 / 4.1}
    made = DESIGN | {"body": square, "electrodes": {"count": 8}, "punch": {"diameter_mm": 2, "force_N": 0.01}}
    gap = 1e3 * least_gap_m(scene_from({"body": square, "electrodes": {"count": 8}}))
    said = kept_from_edges(design_from(made))
    assert f"touches keep {gap:.3g} mm from all edges" in said
    share = float(said.partition("does on ")[2].partition(" %")[0])
    assert share == pytest.approx(100 * ((38 - 2 * gap) / 40) ** 2, abs=1)
    for place in ({"gap_mm": 4}, {"list": [[0, 0]]}):
        assert kept_from_edges(design_from(made | {"punch": made["punch"] | {"place": place}})) == ""
    assert kept_from_edges(design_from({"scenes": 2, "punch": {"force_N": 0.2}})) == ""


def test_a_small_skin_has_its_own_electrodes():
    """16 of the default width would not fit along its edge."""
    small = {"outline": "rectangle", "width_mm": 30, "height_mm": 30, "thickness_mm": 2}
    made = DESIGN | {"body": small, "electrodes": {"count": 16, "width_mm": 2}}
    gaps = gaps_of(made | {"punch": {"diameter_mm": 4, "force_N": 0.05, "place": {"gap_mm": 3}}}, 20)
    assert gaps.min() >= 0.003


@pytest.mark.slow
def test_places_are_uniform_over_what_is_left():
    """Shares of a fine grid of both numbers in four parts of the skin are those of their areas."""
    scene = scene_from({"body": BODY})
    u = (np.arange(40) + 0.5) / 40
    found = np.array([on_outline(a, b, scene, 10.0, 5.0, np.inf) for a in u for b in u]) / 1e3
    at = np.stack(np.meshgrid(np.arange(0.00025, 0.2, 0.0005), np.arange(0.00025, 0.2, 0.0005)), axis=-1).reshape(-1, 2)
    free = at[edge_distance_m(scene.body.outline, at) >= 0.01]
    assert edge_distance_m(scene.body.outline, found).min() >= 0.01
    for low, high in (((0, 0), (0.05, 0.05)), ((0, 0.1), (0.1, 0.2)), ((0.1, 0), (0.2, 0.05)),
                      ((0.03, 0), (0.08, 0.1))):
        shares = [np.mean(np.all((points > low) & (points < high), axis=1)) for points in (found, free)]
        assert shares[0] == pytest.approx(shares[1], abs=0.02)


def test_within_counts_from_the_origin():
    scene = scene_from({"body": BODY})
    found = np.array([on_outline(a, b, scene, 10.0, 5.0, 60.0) for a in (0.01, 0.5, 0.99) for b in (0.01, 0.5, 0.99)])
    assert np.linalg.norm(found, axis=1).max() <= 60


def test_a_skin_without_room_says_how_much_there_is():
    with pytest.raises(ValueError, match=r"finds no place that keeps .* mm from all edges .* largest gap there is 1"):
        scene_at(design_from(DESIGN | {"punch": {"diameter_mm": 70, "place": {"gap_mm": 20}}}), 0)


@pytest.mark.parametrize(("change", "said"), [
    ({"punch": {"place": {"grid": "square", "spacing_mm": 10}}}, "grid of place in \\[punch\\] is laid on discs alone"),
    ({"body": BODY | {"outline": "rectangle", "points_mm": [], "width_mm": [100, 120], "height_mm": 80}},
     "width_mm in \\[body\\] is drawn"),
    ({"fields": {"names": ["strain"], "grid": "polar"}}, "grid = \"polar\" in \\[fields\\] lies on discs alone"),
])
def test_what_is_laid_on_discs_alone_is_refused(change, said):
    with pytest.raises(ValueError, match=said):
        design_from(DESIGN | change)


def test_fields_lie_on_the_square_about_the_skin():
    body, stored = scene_from({"body": BODY}).body, StoredFields(("strain",), side=100)
    there = inside(stored, body)
    assert there.mean() * 0.2**2 == pytest.approx(area_m2(body.outline), rel=0.01)
    np.testing.assert_allclose(places(stored, body)[[0, -1], [0, -1]], [[0.001, 0.001], [0.199, 0.199]])
    assert blank(stored, "strain").shape == there.shape
    disc = Body()
    np.testing.assert_allclose(places(stored, disc)[[0, -1], [0, -1]], [[-0.099, -0.099], [0.099, 0.099]])
