"""Real skins that others measured, in ../shared/real; skipped where they are not there."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors.labels import labels_of, places_of
from eitsim.sensors.sensor_file import read_sensor
from surrogate.model.recorded.reader_scores import read_rows
from surrogate.recordings import press_reader, templates
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.presses import taken
from surrogate.recordings.worth import SURE

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))
import few_labels  # noqa: E402  # pyright: ignore
import suggest  # noqa: E402  # pyright: ignore
from real_skins import REAL, Case, recorded, rows_of, with_drift  # noqa: E402  # pyright: ignore

pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="the recordings of real skins are not here")

# Mean distance, mm, that 100 labels just before the test must reach on the last fifth of the presses in time.
HUNDRED = {"skin_plain": 3.0, "skin_radial": 5.0, "skin_carbon": 7.5, "hydrogel": 3.0}


def test_templates_read_the_hydrogel_from_a_hundred_presses() -> None:
    _, presses, labels = recorded("hydrogel")
    place = labels.values[:, :2]
    train, test = rows_of(Case("hydrogel", 100, "time", "last"), len(place))
    fitted = templates.fit(presses.signal[train], place[train], time_blocks(100), compress=False)
    error = fitted.templates.read(presses.signal[test])[0] - place[test]
    assert np.linalg.norm(error, axis=1).mean() <= 3.0


# Mean distance, mm, of four draws of twenty labels, and the least part of it that kernel ridge regression must have.
TWENTY = {"skin_plain": 4.8, "skin_radial": 10.0, "skin_carbon": 13.5, "hydrogel": 5.0}


@pytest.mark.slow
@pytest.mark.parametrize("skin", TWENTY)
def test_twenty_random_presses_read_better_than_kernel_ridge_and_are_held(skin: str) -> None:
    scores = [few_labels.measured(few_labels.Case(skin, 20, draw)) for draw in range(4)]
    error, ridge, inside = (np.array([one[key] for one in scores], float) for key in (
        "error_mm", "kernel_ridge_mm", "x_in_90"))
    assert error.mean() <= TWENTY[skin]
    assert error.mean() <= 1.05 * ridge.mean()
    assert 0.84 <= np.mean([inside, [float(str(one["y_in_90"])) for one in scores]]) <= 0.97


@pytest.mark.slow
@pytest.mark.parametrize("skin", suggest.CHOSEN_ON)
def test_twenty_suggested_presses_teach_as_much_as_thirty_random_ones(skin: str) -> None:
    random, suggested = (suggest.measured(suggest.Case(skin, "templates", way, 0, count))
                         for way, count in (("random", 30), ("suggested", 20)))
    error, spread = (np.array([float(str(one[key])) for one in (random, suggested)]) for key in ("error_mm", "se_mm"))
    assert error[1] <= error[0] + SURE * np.hypot(*spread)  # chance alone exceeds it once in 20 times


@pytest.mark.slow
@pytest.mark.parametrize("skin", HUNDRED)
def test_a_hundred_presses_suffice(skin: str) -> None:
    _, presses, labels = recorded(skin)
    train, test = rows_of(Case(skin, 100, "time", "last"), len(labels.touch))
    found = read_rows(presses, labels, train, test, "time", 0)[0].score
    assert found.error <= HUNDRED[skin]
    assert found.error < found.ridge_error
    assert 0.85 <= np.mean(found.coverage) <= 0.95  # x and y together: the hydrogel has 70 tested presses


@pytest.mark.slow
def test_intervals_hold_on_the_hydrogel_without_an_electrode() -> None:
    _, presses, labels = recorded("hydrogel")
    train, test = rows_of(Case("hydrogel", 100, "time", "last"), len(labels.touch))
    reader = press_reader.fit(taken(presses, train), labels_of(labels, train))
    protocol, tested = read_sensor(REAL / "hydrogel" / "sensor.toml").protocol, taken(presses, test)
    used = (np.abs(protocol.weights) + np.abs(protocol.currents_A)[:, None]).reshape(-1, protocol.weights.shape[-1])
    for electrode in (3, 9, 14):
        found = press_reader.read(reader, replace(tested, signal=np.where(used[:, electrode] > 0, np.nan,
                                                                         tested.signal))).place
        assert found
        inside = np.abs(found.value - places_of(labels)[test]) <= found.bounds.half_width
        assert 0.84 <= inside.mean() <= 0.98


@pytest.mark.slow
@pytest.mark.parametrize(("drift", "most"), [("20 old", 5.5), ("every 10", 4.0)])
def test_the_hydrogel_is_read_through_drift(drift: str, most: float) -> None:
    recording, presses, labels = recorded("hydrogel")
    train, test = rows_of(Case("hydrogel", 100, "time", "last"), len(labels.touch))
    found = read_rows(with_drift(recording, presses, drift), labels, train, test, "time", 0)[0].score
    assert found.error <= most
