"""Which rows were solved near an edge: by the kinds of their routes, of earlier sets by the words that these hold."""

import pandas as pd
import pytest

from eitsim.simulation.routes.known_routes import ROUTES
from eitsim.sweeps.dataset.touch_kinds import FAR, KIND, near_edge


def test_every_route_but_those_without_edges_is_near_one() -> None:
    kinds = [route.kind for route in ROUTES]
    near = near_edge(pd.DataFrame({KIND: kinds}))
    assert {kind for kind, edge in zip(kinds, near, strict=True) if not edge} == FAR - {""}


@pytest.mark.parametrize(("columns", "expected"), [
    ({KIND: ["axisymmetric", "all_edges", "axisymmetric, pair", "all_edges, pair", ""]}, [0, 1, 0, 1, 0]),
    ({"mechanics_method": ["solved", "table near the rim", "solved with a neighbour"]}, [0, 1, 0]),
    ({KIND: [None, None, "nearest_edge"], "mechanics_method": ["solved near the rim", "table", "table"]}, [1, 0, 1]),
    ({"scene": [0, 1]}, [0, 0])], ids=["kinds", "an earlier set", "parts of both", "neither"])
def test_rows_near_an_edge_are_known(columns: dict[str, list], expected: list[int]) -> None:
    assert near_edge(pd.DataFrame(columns)).tolist() == expected
