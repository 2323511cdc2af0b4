"""Mechanics that the sweeps of many tests have in common."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.load_paths.build_table import Run, build
from eitsim.mechanics.load_paths.types import DimensionlessProblem, Table
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch
from eitsim.simulation import reuse
from eitsim.simulation.routes import axisymmetric
from matcal.laws.hyperfoam import Hyperfoam

Numbers = tuple[float, ...]


@pytest.fixture
def solved_once(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of what a sweep does with its rows, not of their numbers: a touch alone, or a table of load paths, that
    this process has solved before for the same arguments is taken as it is. Slow tests solve them all."""
    if request.node.get_closest_marker("slow") is None:
        monkeypatch.setattr(axisymmetric, "solve_touch", _touch)
        monkeypatch.setattr(reuse, "build", _table)


def _touch(law: Hyperfoam, body: Body, punch: Punch, **mesh: Any) -> Touch:
    mu, alpha, nu = (tuple(part.tolist()) for part in (law.mu_Pa, law.alpha, law.nu))
    return _solved(mu, alpha, nu, law.moduli, body, punch, tuple(mesh.items()))


@cache
def _solved(mu: Numbers, alpha: Numbers, nu: Numbers, moduli: str, body: Body, punch: Punch,
            mesh: tuple[tuple[str, Any], ...]) -> Touch:
    law = Hyperfoam(np.array(mu), np.array(alpha), np.array(nu), moduli)
    return solve_touch(law, body, punch, **dict(mesh))


def _table(shape: DimensionlessProblem, run: Run, depths: Sequence[float]) -> Table:
    return _built(shape, tuple(depths))


@cache
def _built(shape: DimensionlessProblem, depths: Numbers) -> Table:
    return build(shape, map, depths)
