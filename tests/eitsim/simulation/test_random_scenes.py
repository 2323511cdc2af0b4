"""No random scene fails: the draws of benchmarks/random_scenes.py, a few here, more among the slow tests."""

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.simulation.validity import check_positive
from matcal.laws.conductivity import NotPositive


@pytest.fixture(scope="module")
def study(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    """The benchmark as a module."""
    return benchmark_module("random_scenes")


def failures(study, count, where, friction):
    """Rows of the first scenes of that kind that end neither "ok" nor "bottomed_out", nor are rightly refused."""
    drawn = ((k, *study.scene_of(k)) for k in range(study.SCENES))
    kind = [(k, name, scene) for k, name, scene in drawn
            if study.place_of(scene) == where and scene.punches[0].friction == friction][:count]
    assert len(kind) == count
    rows = [study.solved(*scene) for scene in kind]
    print("CPU seconds: median", np.median([row["cpu_s"] for row in rows]), "most", max(row["cpu_s"] for row in rows))
    return [row for row, (_, name, scene) in zip(rows, kind, strict=True) if row["outcome"] not in (
        "ok", "bottomed_out") and not (row["outcome"] == "refused" and out_of_the_skins_law(study, name, scene))]


def out_of_the_skins_law(study, name, scene):
    """Whether a touch that is found strains the skin to where the benchmark's cubic is not positive."""
    touch = solve_touch(study.LAWS[name], scene.body, scene.punches[0])
    try:
        check_positive(study.SKIN_LAW, scene.skin.strain, [touch])
    except NotPositive:
        return True
    return False


@pytest.mark.thorough
def test_few_scenes(study):
    assert failures(study, 8, "interior", "none") == []


@pytest.mark.slow
def test_many_scenes(study):
    assert failures(study, 300, "interior", "none") == []


def test_a_run_continues_where_it_ended(study, tmp_path):
    path = tmp_path / "scenes.csv"
    for last in (0, 14, 14):
        study.solve_missing(path, last, "interior", "none", np.inf)
    table = study.table_of(path)
    assert table["scene"].is_unique
    assert len(table) == sum(study.place_of(scene) == "interior" and scene.punches[0].friction == "none"
                             for _, scene in map(study.scene_of, range(14)))
    assert "100.00%" in study.summary(table)
