"""The page's edges of a skin are those of Python: what they refuse and where presses are held."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from surrogate.data.skin_edges import Circle, Polygons
from surrogate.live.serve import PAGE

GAP_MM, DIAMETER_MM = 11.0, 10.0
TURN = np.linspace(0, -2 * np.pi, 24, endpoint=False)
EDGES = Polygons((np.array([[0, 0], [120, 0], [120, 60], [60, 60], [60, 120], [0, 120.0]]),
                  np.array([30, 90]) + 6 * np.column_stack([np.cos(TURN), np.sin(TURN)])))


def places() -> list[tuple[float, float]]:
    found = np.random.default_rng(1).uniform(-10, 130, (300, 2))
    return [(float(x), float(y)) for x, y in found]


def test_the_page_refuses_what_python_refuses(page: Any, tmp_path: Path) -> None:
    script = (PAGE / "skin.js").read_text(encoding="utf-8")
    (tmp_path / "page.html").write_text(f"<!doctype html><meta charset='utf-8'><script>{script}</script>",
                                        encoding="utf-8")
    page.browser.get((tmp_path / "page.html").as_uri())
    asked = ("const edge = edgeOf(arguments[0]); return arguments[1].map(p => "
             "[edge.refusal(p, arguments[2], arguments[3]), ...edge.held(p)])")
    found = page.run(asked, EDGES.document(), places(), DIAMETER_MM, GAP_MM)
    away = np.array([EDGES.distance_mm(one) for one in places()])
    assert [bool(words) for words, *_ in found] == [EDGES.refuses(one, DIAMETER_MM, GAP_MM) for one in places()]
    assert [words for words, *_ in found] == [
        "the punch does not lie on the skin" if one < DIAMETER_MM / 2 else
        "nearer to an edge than the model knows" if one < GAP_MM else "" for one in away]
    assert np.array([held for _, *held in found]) == pytest.approx(
        np.array([EDGES.held(one, GAP_MM) for one in places()]), abs=1e-3)
    alone = Polygons(EDGES.loops_mm, 25.0)
    found = page.run(asked, alone.document(), places(), DIAMETER_MM, GAP_MM)
    assert [bool(words) for words, *_ in found] == [alone.refuses(one, DIAMETER_MM, GAP_MM) for one in places()]
    assert sum(words == "nearer to two edges than the model knows" for words, *_ in found) > 20
    circle = Circle((0.0, 0.0), 100.0)
    pulled = page.run("const edge = edgeOf(arguments[0]); return arguments[1].map(p => edge.held(p, arguments[2]))",
                      circle.document(), places(), GAP_MM)
    assert np.array(pulled) == pytest.approx(np.array([circle.held(one, GAP_MM) for one in places()]))
