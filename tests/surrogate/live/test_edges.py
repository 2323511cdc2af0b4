"""Edges of a skin: how far places are from them, and which presses they refuse, in Python and on the page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitsim.scene.outline import edge_distance_m
from eitsim.scene.scene import Body, Electrodes
from surrogate.data.skin_from_above import skin_of
from surrogate.live.edges import SLACK_MM, Circle, Polygons
from surrogate.live.serve import PAGE

L_WITH_HOLE = Body(outline="polygon", thickness_m=0.005, holes_m=((0.03, 0.09, 0.006),), points_m=(
    (0.0, 0.0), (0.12, 0.0), (0.12, 0.06), (0.06, 0.06), (0.06, 0.12), (0.0, 0.12)))
GAP_MM, DIAMETER_MM = 11.0, 10.0


@pytest.fixture(scope="module")
def edges() -> Polygons:
    return Polygons(skin_of(L_WITH_HOLE.shape, Electrodes(count=12, width_m=0.008)).loops_mm)


def places() -> list[tuple[float, float]]:
    found = np.random.default_rng(1).uniform(-10, 130, (300, 2))
    return [(float(x), float(y)) for x, y in found]


def test_distances_are_those_of_the_outline(edges: Polygons) -> None:
    known = 1e3 * edge_distance_m(L_WITH_HOLE.shape, 1e-3 * np.array(places()))
    assert [edges.distance_mm(one) for one in places()] == pytest.approx(known.tolist(), abs=1e-9)


def test_presses_in_holes_and_near_edges_are_refused(edges: Polygons) -> None:
    away = np.array([edges.distance_mm(one) for one in places()])
    refused = np.array([edges.refuses(one, DIAMETER_MM, GAP_MM) for one in places()])
    assert 10 < np.sum(~refused) < 250
    assert np.array_equal(refused, away < GAP_MM - SLACK_MM)
    assert edges.refuses((30.0, 90.0), 1.0, 0.0)  # in the hole
    assert not edges.refuses((30.0, 30.0), 59.0, 5.0)
    assert edges.refuses((30.0, 30.0), 61.0, 5.0)  # the punch overhangs


def test_a_circle_pulls_instead_of_refusing() -> None:
    circle = Circle((1.0, 2.0), 50.0)
    assert circle.held((61.0, 82.0), 40.0) == pytest.approx((7.0, 10.0))
    assert circle.held((3.0, 4.0), 40.0) == (3.0, 4.0)
    assert not circle.refuses((49.0, 2.0), 20.0, 40.0)


def test_the_page_refuses_what_python_refuses(page: Any, edges: Polygons, tmp_path: Path) -> None:
    script = (PAGE / "skin.js").read_text(encoding="utf-8")
    (tmp_path / "page.html").write_text(f"<!doctype html><meta charset='utf-8'><script>{script}</script>",
                                        encoding="utf-8")
    page.browser.get((tmp_path / "page.html").as_uri())
    asked = ("const edge = edgeOf(arguments[0]); return arguments[1].map(p => "
             "[edge.refusal(p, arguments[2], arguments[3]), ...edge.held(p)])")
    found = page.run(asked, edges.document(), places(), DIAMETER_MM, GAP_MM)
    away = np.array([edges.distance_mm(one) for one in places()])
    assert [bool(words) for words, *_ in found] == [edges.refuses(one, DIAMETER_MM, GAP_MM) for one in places()]
    assert [words for words, *_ in found] == [
        "the punch does not lie on the skin" if one < DIAMETER_MM / 2 else
        "nearer to an edge than the model knows" if one < GAP_MM else "" for one in away]
    assert np.array([held for _, *held in found]) == pytest.approx(
        np.array([edges.held(one, GAP_MM) for one in places()]), abs=1e-3)
    circle = Circle((0.0, 0.0), 100.0)
    pulled = page.run("const edge = edgeOf(arguments[0]); return arguments[1].map(p => edge.held(p, arguments[2]))",
                      circle.document(), places(), GAP_MM)
    assert np.array(pulled) == pytest.approx(np.array([circle.held(one, GAP_MM) for one in places()]))
