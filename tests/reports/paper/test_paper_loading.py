"""The loading time that the paper's drop of the mean pressure asks for, and the law and the cycles of its material."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.paper import cyclic, loading
from benchmarks.paper.stages_plan import DATA, SCENES
from benchmarks.paper.stated_law import table_1
from eitsim.scene.scene import read_scene
from matcal.card import MaterialCard, write_card
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony, relaxation
from matcal.reduction.reduce import read_test
from reports.document.style import house
from touchcal.errors import NotConverged

ONE = Prony(np.array([0.3]), np.array([4.0]))
LAW = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3), "longterm")


def test_a_ramp_of_one_term_loses_what_its_integral_says() -> None:
    for loading_s in (0.01, 1.0, 30.0):
        (g,), (tau,) = ONE.g, ONE.tau_s
        relaxing = g * tau / loading_s * -np.expm1(-loading_s / tau)
        first, last = (1 - g + relaxing * np.exp(-t / tau) for t in (0.0, loading.WITHIN_S))
        assert loading.lost_by_series(ONE, loading_s) == pytest.approx(1 - last / first, rel=1e-6)


def test_loading_at_once_loses_what_the_series_does() -> None:
    series = table_1().series
    lost = 1 - float(relaxation(series, loading.WITHIN_S))
    assert loading.lost_by_series(series, 1e-6) == pytest.approx(lost, rel=1e-5)


@pytest.mark.parametrize("near_s", [(1.0, 8.0), (10.0, 20.0)])
def test_the_time_that_loses_a_share_is_found_inside_and_outside_its_bracket(near_s: tuple[float, float]) -> None:
    asked: list[float] = []

    def lost(loading_s: float) -> float:
        asked.append(loading_s)
        return 0.2 * float(np.exp(-loading_s / 5))

    found = loading.time_that_loses(0.1, lost, near_s)
    assert found == pytest.approx(5 * np.log(2), rel=2 * loading.ACCURACY)
    assert len(asked) == len(set(asked))


def test_a_share_that_no_loading_loses_is_refused() -> None:
    with pytest.raises(NotConverged, match="loses 30 % in 2 s"):
        loading.time_that_loses(0.3, lambda loading_s: 0.2 / (1 + loading_s), (1.0, 2.0))


def test_the_scene_that_is_written_differs_in_its_loading_time_alone(tmp_path: Path,
                                                                     monkeypatch: pytest.MonkeyPatch) -> None:
    table = table_1()
    write_card(MaterialCard("Table 1", LAW, table.series), tmp_path / "card.json")
    monkeypatch.setattr(loading, "lost_by_touch", lambda scene, card, loading_s: 0.2 * np.exp(-loading_s / 3))
    loading.main(str(SCENES / "hold_depth.toml"), str(tmp_path / "card.json"), str(tmp_path / "out.toml"))
    before, after = read_scene(SCENES / "hold_depth.toml"), read_scene(tmp_path / "out.toml")
    assert after.hold.loading_s == pytest.approx(3 * np.log(2), rel=2 * loading.ACCURACY)
    assert replace(after, hold=replace(after.hold, loading_s=0.0)) == before
    assert before.hold.time_s == (2, 5, 60, 120, 180)


@pytest.mark.slow
def test_a_touch_of_table_1_loses_less_the_slower_it_is_loaded() -> None:
    card = MaterialCard("Table 1", LAW, table_1().series)
    scene = read_scene(SCENES / "hold_depth.toml")
    once, fast, slow = (loading.lost_by_touch(scene, card, loading_s) for loading_s in (1e-3, 1.0, 4.0))
    assert once == pytest.approx(1 - float(relaxation(table_1().series, loading.WITHIN_S)), abs=2e-3)
    assert once > fast > 0.10 > slow


def test_table_1_is_read_as_it_is_printed() -> None:
    law = table_1()
    assert law.foam.mu_Pa == pytest.approx(LAW.mu_Pa)
    assert law.foam.alpha == pytest.approx(LAW.alpha)
    assert law.series.g == pytest.approx([0.1505, 0.1696, 0.0604])
    assert law.series.tau_s == pytest.approx([0.2936, 5.85, 81.672])
    assert "paper" in law.words


def test_resistance_and_displacement_stand_on_one_clock() -> None:
    files, specimen = [DATA / "mts_cyclic.txt", DATA / "nova_cyclic.txt"], DATA / "specimen.toml"
    rows = cyclic.record(files, specimen)
    assert rows["displacement_mm"].max() == pytest.approx(4.0, abs=0.05)
    cycles = read_test({"conductivity": files}, specimen).cycles
    assert cycles is not None
    last = rows["time_s"] > rows["time_s"].max() * 0.9
    stretched = rows["displacement_mm"] > 3.9
    assert rows.loc[last & stretched, "resistance_Ohm"].mean() == pytest.approx(
        cycles["resistance_peak_Ohm"][-1], rel=0.01)
    assert rows["resistance_Ohm"][last].corr(rows["displacement_mm"][last]) > 0.99
    with house():
        plate = cyclic.over_time("figure_6b", rows)
    resistance, stretch = plate.figure.axes
    assert (resistance.get_ylabel(), stretch.get_ylabel(), stretch.get_xlabel()) == (
        "Resistance (kΩ)", "Stretch (mm)", "Time (s)")
    assert "cycles of 3.99 mm" in plate.caption
