"""Tables of load paths in the cache: every array comes back as it was made, and nothing is made twice."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from eitsim.mechanics.load_paths.load_path import Deviation
from eitsim.mechanics.load_paths.table import shape_of
from eitsim.mechanics.load_paths.types import RimTable, Table
from eitsim.scene.scene import Body, Punch
from eitsim.simulation import reuse
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam(np.array([9530.0]), np.array([8.0]), np.array([0.0]), "longterm")
SHAPE = shape_of(FOAM, Body(), Punch())


def random(*shape: int) -> np.ndarray:
    return np.random.default_rng(0).random(shape)


def made_table() -> Table:
    """Arrays by chance, of the dimensions of a table's."""
    return Table(SHAPE, np.linspace(0.1, 0.5, 5), random(4), random(1, 5, 30), 1 + random(1, 5, 30), random(1, 5, 11),
                 Deviation(0.1, np.array([0.2, 0.3, 0.4]), 0.5), 7, 8.5)


def made_changes() -> RimTable:
    return RimTable(random(1), random(3), random(4), random(6), random(2), random(1, 3, 4, 5).astype(np.float32),
                    random(1, 3, 4, 9), random(2, 4, 4), 1 + random(2, 4, 4), 3.5)


def made_once(monkeypatch: pytest.MonkeyPatch, place: object, name: str, found: object) -> None:
    """The second call of a function finds nothing."""
    left = [found]
    monkeypatch.setattr(place, name, lambda *_: left.pop())


def assert_same(found: object, expected: object) -> None:
    for field in fields(expected):  # pyright: ignore[reportArgumentType]
        one, other = (getattr(whole, field.name) for whole in (found, expected))
        if isinstance(other, np.ndarray):
            np.testing.assert_array_equal(one, other, err_msg=field.name)


@pytest.fixture(autouse=True)
def kept_here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path))
    made_once(monkeypatch, reuse, "build", made_table())
    made_once(monkeypatch, reuse, "build_rim", made_changes())


def test_a_table_with_what_the_rim_changes_comes_back() -> None:
    for _ in range(2):
        found, note = reuse.table_for(SHAPE, rim=True)
        assert note == ""
        assert_same(found, made_table())
        assert (found.error.depth, found.checks, found.cpu_s) == (0.1, 7, 8.5)
        assert found.rim is not None
        assert_same(found.rim, made_changes())
        assert found.rim.cpu_s == 3.5
