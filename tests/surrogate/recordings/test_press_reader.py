"""Labels of any subset on synthetic presses, no skin measured: what is read, what is left out and why."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import surrogate
from eitsim.sensors.labels import Labels
from eitsim.sensors.recording import Recording
from surrogate.data.dead_readings import teaching_nothing
from surrogate.model.recorded import lost_channels
from surrogate.model.recorded.learn_presses import choice, learn
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.recorded.reader_scores import read_split
from surrogate.recordings import dead_channels, press_reader
from surrogate.recordings.dead_channels import filled, filled_without, learn_readings
from surrogate.recordings.press_reader import PressReader
from surrogate.recordings.presses import Presses
from surrogate.recordings.worth import NothingToRead
from surrogate.statistics.conformal import radius
from touchcal.arrays import Array

from .conftest import RING, labels_at, short_networks, synthetic_places, synthetic_presses, synthetic_signal


@pytest.fixture(scope="module", autouse=True)
def quick() -> object:
    """Few, short networks: what is tested here does not depend on how well they learn."""
    with short_networks():
        yield


def deep(seed: int, count: int) -> tuple[Presses, Array, Array]:
    """Presses, their places and their depths, mm, to which signals are in proportion."""
    rng = np.random.default_rng(seed)
    place, depth = synthetic_places(rng, count), rng.uniform(5, 15, count)
    signal = synthetic_signal(place, depth)
    signal += 0.1 * np.abs(signal).mean() * rng.standard_normal(signal.shape)
    return Presses(np.arange(count).astype(np.str_), np.arange(count), signal, np.full_like(signal, np.nan),
                   np.zeros(count), np.empty((0, signal.shape[1])), np.empty(0),
                    np.arange(float(count))), place, depth


def only(labels: Labels, *names: str) -> Labels:
    return Labels(labels.touch, names, labels.values[:, [labels.names.index(name) for name in names]])


@pytest.fixture(scope="module")
def reader() -> PressReader:
    """Of place and depth; the force is the same in all presses."""
    presses, place, depth = deep(1, 80)
    return press_reader.fit(presses, labels_at(place, depth_mm=depth, F_N=np.full(80, 0.5)))


def test_depth_and_place_are_read_and_held(reader: PressReader) -> None:
    new, there, deeper = deep(2, 200)
    found = press_reader.read(reader, new)
    (said,) = found.scalars
    error = np.abs(said.value - deeper)
    assert said.name == "depth_mm"
    assert error.mean() < 0.35 * np.abs(deeper.mean() - deeper).mean()
    assert 0.78 < np.mean(error <= said.half_width) < 0.99  # 80 presses calibrate
    assert found.place
    assert np.linalg.norm(found.place.value - there, axis=1).mean() < 8
    assert 0.8 < np.mean(radius(found.place.value - there, found.place.bounds) <= found.place.bounds.ellipse) < 0.99


def test_depth_alone_is_learnt() -> None:
    presses, place, depth = deep(1, 80)
    labels = only(labels_at(place, depth_mm=depth), "depth_mm")
    reader = press_reader.fit(presses, labels)
    assert reader.place is None
    (tested,) = read_split(presses, labels, "time")
    one = tested.score
    assert (one.output, one.unit, one.trained) == ("depth_mm", "mm", 64)
    assert one.error < 0.7 * one.mean_error


def test_one_coordinate_is_learnt_by_itself_and_has_the_columns_of_places() -> None:
    presses, place, _ = deep(1, 80)
    reader = press_reader.fit(presses, only(labels_at(place), "y_mm"))
    frames = Recording(presses.signal, presses.index, None, presses.name, "difference", Path("synthetic.csv"))
    table = PressModel(reader, "difference", 80, 80, 0, (), 1.0).predict(frames)
    assert [*table] == ["touch", "y0_mm", "y0_lo90_mm", "y0_hi90_mm", "flag"]
    assert np.corrcoef(table["y0_mm"], place[:, 1])[0, 1] > 0.9


def test_a_constant_label_is_left_out_by_name_and_refused_alone(reader: PressReader) -> None:
    assert [one.name for one in reader.scalars] == ["depth_mm"]
    assert reader.left_out == ("all labelled presses have one F_N, 0.5: press with several, or leave the column out.",)
    assert reader.left_out[0] in choice(reader)
    presses, place, _ = deep(1, 80)
    with pytest.raises(ValueError, match="have one F_N, 0"):
        press_reader.fit(presses, only(labels_at(place, F_N=np.full(80, 0.5)), "F_N"))


def test_a_label_that_signals_do_not_hold_is_left_out_and_the_place_stays() -> None:
    presses, place, depth = deep(1, 60)
    shuffled = np.random.default_rng(200).permutation(depth)
    reader = press_reader.fit(presses, labels_at(place, F_N=shuffled))
    assert reader.place
    assert not reader.scalars
    assert "nothing to read here of F_N" in reader.left_out[0]


def test_where_no_label_is_read_the_refusal_names_each() -> None:
    presses, place, depth = deep(1, 60)
    rng = np.random.default_rng(5)
    labels = labels_at(rng.permutation(place), depth_mm=rng.permutation(depth))
    with pytest.raises(NothingToRead, match=r"of the place.*of depth_mm"):
        press_reader.fit(presses, labels)


def test_stored_readers_with_and_without_places_read_the_same(reader: PressReader, tmp_path: Path) -> None:
    presses, place, depth = deep(1, 60)
    of_depth = press_reader.fit(presses, only(labels_at(place, depth_mm=depth), "depth_mm"))
    for name, one in (("both", reader), ("depth", of_depth)):
        PressModel(one, "difference", 60, 60, 0, (), 1.5).save(tmp_path / name)
        again = surrogate.load(tmp_path / name).reader
        first, second = (press_reader.read(part, synthetic_presses(8, 5)[0]).scalars[0] for part in (one, again))
        np.testing.assert_array_equal(first.value, second.value)
        np.testing.assert_array_equal(first.half_width, second.half_width)
        assert (again.place is None) == (name == "depth")


def test_a_dead_channel_widens_and_flags_nothing_without_places_too() -> None:
    presses, place, depth = deep(1, 60)
    reader = press_reader.fit(presses, only(labels_at(place, depth_mm=depth), "depth_mm"))
    dead = presses.signal.copy()
    dead[0, 9] = np.nan
    whole, found = (press_reader.read(reader, one) for one in (presses, replace(presses, signal=dead)))
    assert not any(found.flag)
    wider = found.scalars[0].half_width > whole.scalars[0].half_width
    assert wider.tolist() == [True] + 59 * [False]


def test_signals_filled_in_leave_one_out_are_those_of_readings_learnt_without_each() -> None:
    rng = np.random.default_rng(3)
    signal = rng.standard_normal((30, 4)) @ rng.standard_normal((4, 12)) + 0.1 * rng.standard_normal((30, 12))
    dead = np.isin(np.arange(12), (2, 7, 8))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dead_channels, "RIDGE", 1e-9)  # a share of the variance, which a row less changes
        found = filled_without(learn_readings(signal), dead)
        for row in range(30):
            others = learn_readings(np.delete(signal, row, axis=0))
            np.testing.assert_allclose(found[row], filled(others, np.where(dead, np.nan, signal[[row]]))[0], rtol=1e-4)


@pytest.mark.parametrize("lost", ["an electrode", "104 at random"])
def test_intervals_hold_where_many_channels_are_filled_in(reader: PressReader, lost: str) -> None:
    new, there, deeper = deep(3, 200)
    dead = np.zeros(new.signal.shape[1], bool)
    dead[np.random.default_rng(0).permutation(len(dead))[:104]] = True
    if lost == "an electrode":
        dead = np.any([ends == 3 for ends in (RING.source, RING.sink, RING.read, RING.ground)], axis=0)
    found = press_reader.read(reader, replace(new, signal=np.where(dead, np.nan, new.signal)))
    assert found.place
    assert 0.84 <= np.mean(np.abs(found.place.value - there) <= found.place.bounds.half_width) <= 0.98
    assert 0.84 <= np.mean(np.abs(found.scalars[0].value - deeper) <= found.scalars[0].half_width) <= 0.98


def test_frames_most_of_which_are_dead_have_no_value(reader: PressReader) -> None:
    new, _, _ = deep(3, 4)
    lacking = new.signal.copy()
    lacking[0, :105] = lacking[1] = np.nan
    lacking[2, :104] = np.nan
    frames = Recording(lacking, new.index, None, new.name, "difference", Path("synthetic.csv"))
    table = PressModel(reader, "difference", 80, 80, 0, (), 0.0).predict(frames)
    values = table.drop(columns=["touch", "flag", "x0_y0_correlation", "x0_y0_ellipse90"]).to_numpy(float)
    assert np.isnan(values[:2]).all()
    assert np.isfinite(values[2:]).all()
    assert table["flag"].tolist()[:3] == ["105 of 208 readings are dead, and half or more are needed",
                                          "208 of 208 readings are dead, and half or more are needed", ""]


def test_a_stuck_channel_is_read_as_a_dead_one_which_is_said_once(reader: PressReader) -> None:
    model, (new, _, _) = PressModel(reader, "difference", 80, 80, 0, (), 0.0), deep(3, 6)
    tables, said = [], []
    for channel in (None, np.nan, 0.25):
        signal = new.signal.copy()
        signal[:, [9]] = signal[:, [9]] if channel is None else channel
        said.append([])
        tables.append(model.predict(recorded(replace(new, signal=signal)), said[-1].append))
    pd.testing.assert_frame_equal(tables[1], tables[2])
    assert (tables[1]["x0_mm"] != tables[0]["x0_mm"]).all()
    assert not tables[1]["flag"].any()
    assert said[0] == []
    assert said[1] == said[2]
    (words,) = said[1]
    assert words.startswith("in 6 of 6 frames v_009 is dead and left out")
    with_it, without = (float(words.partition(part)[2].split()[0]) for part in ("without, ", "presses: place about "))
    assert with_it == pytest.approx(reader.errors["place"], rel=5e-3)
    assert with_it <= without < 1.5 * with_it


def test_a_channel_that_sticks_from_some_press_on_is_dead_from_there(reader: PressReader) -> None:
    model, (new, _, _) = PressModel(reader, "difference", 80, 80, 0, (), 0.0), deep(3, 20)
    tables, said = [], []
    for value in (np.nan, new.signal[9, 9]):
        signal = new.signal.copy()
        signal[9:, 9] = value
        tables.append(model.predict(recorded(replace(new, signal=signal)), said.append))
    pd.testing.assert_frame_equal(*tables)
    assert said[0] == said[1]
    assert said[0].startswith("in 11 of 20 frames v_009 is dead and left out")


def test_a_channel_that_sticks_while_presses_are_recorded_teaches_as_a_dead_one_and_that_is_said() -> None:
    (presses, place, _), (new, _, _) = deep(5, 40), deep(6, 8)
    models = []
    for value in (np.nan, presses.signal[30, 9]):
        signal = presses.signal.copy()
        signal[30:, 9] = value
        models.append(learn(recorded(replace(presses, signal=signal)), labels_at(place), method="ridge"))
    pd.testing.assert_frame_equal(*(model.predict(recorded(new)) for model in models))
    rest = (" in 10 of 40 labelled frames, the first of them frame 30, and filled in from the others there; mean "
            "errors by the training presses are the same without and with.")
    assert [model.left_out[0] for model in models] == [f"v_009 is {state}{rest}" for state in ("dead", "stuck")]
    known, late = models[0].reader, models[0].reader.signals.late
    lost = np.append(np.arange(known.signals.channels) == 9, late == 9)
    without, with_it, _ = lost_channels._costs(known, lost)["place"]
    assert with_it == pytest.approx(known.errors["place"])
    assert with_it <= without < 1.5 * with_it


def test_a_channel_that_sticks_early_is_left_out_of_training_and_of_frames_read_later() -> None:
    (presses, place, _), (new, _, _) = deep(5, 40), deep(6, 8)
    signal, wild = presses.signal.copy(), new.signal.copy()
    signal[6:, 9] = signal[6, 9]
    named = tuple(f"pin {number}" for number in range(208))
    model = learn(replace(recorded(replace(presses, signal=signal)), columns=named), labels_at(place), method="ridge")
    assert model.left_out[0] == ("pin 9 is stuck and left out altogether, in frames that are read later as well; what "
                                 "that costs is unknown.")
    tables, said = [], []
    for value in (0.0, 50.0, np.nan):
        wild[:, 9] = value
        tables.append(model.predict(recorded(replace(new, signal=wild)), said.append))
    for table in tables[1:]:
        pd.testing.assert_frame_equal(table, tables[0])
    assert not said
    wild[:, 11] = np.nan
    model.predict(replace(recorded(replace(new, signal=wild)), columns=named), said.append)
    assert said[0].startswith("in 8 of 8 frames pin 11 is dead and left out")


def test_channels_that_teach_nothing_are_those_dead_in_most_rows_and_as_few_others_as_leave_rows_whole() -> None:
    dead = np.zeros((12, 6), bool)
    dead[:7, 0] = dead[4:8, 1] = dead[8:11, 2] = dead[11:, 3] = True
    assert [np.flatnonzero(teaching_nothing(dead, fewest)).tolist() for fewest in (0, 4, 5, 9, 12, 13)] == [
        [0], [0], [0, 1], [0, 1, 2], [0, 1, 2, 3], [0, 1, 2, 3]]


def test_two_frames_do_not_show_that_a_channel_is_stuck_nor_does_one_that_rarely_changes(reader: PressReader) -> None:
    model, (new, _, _) = PressModel(reader, "difference", 80, 80, 0, (), 0.0), deep(3, 6)
    signal = new.signal.copy()
    signal[:, 9] = 0.25
    few = recorded(replace(new, signal=signal, name=new.name))
    assert np.isfinite(model.presses_of(replace(few, readings=signal[:2], index=few.index[:2],
                                                touch=few.touch[:2])).signal).all()
    kept = reader.signals.readings.kept.copy()
    kept[3:, 9] = 0.25
    rarely = replace(reader.signals, readings=replace(reader.signals.readings, kept=kept))
    assert np.isfinite(PressModel(replace(reader, signals=rarely), "difference", 80, 80, 0, (), 0.0).presses_of(
        few).signal).all()


def test_no_depth_is_below_0_at_its_lower_end_and_coordinates_may_be() -> None:
    presses, place, _ = deep(1, 60)
    size = np.linalg.norm(presses.signal, axis=1)
    force = (size - size.min()) / np.ptp(size)
    reader = press_reader.fit(presses, labels_at(place, F_N=force, z_mm=force - 0.1))
    frames = Recording(presses.signal, presses.index, None, presses.name, "difference", Path("synthetic.csv"))
    table = PressModel(reader, "difference", 60, 60, 0, (), 0.0).predict(frames)
    value, low, high, coordinate = table[["F_N", "F_lo90_N", "F_hi90_N", "z_lo90_mm"]].to_numpy(float).T
    assert np.all(low >= np.minimum(value, 0))
    assert np.any(2 * value - high < 0)
    assert np.any(coordinate < 0)


def recorded(presses: Presses) -> Recording:
    return Recording(presses.signal, presses.index, None, presses.name, "difference", Path("synthetic.csv"))


def test_a_split_that_teaches_nothing_has_no_score_and_the_reader_is_trained() -> None:
    presses, place, _ = deep(1, 60)
    depth = np.where(np.arange(60) < 48, 5.0, 12.0)
    signal = synthetic_signal(place, depth)
    labels = only(labels_at(place, depth_mm=depth), "depth_mm")
    model = learn(recorded(replace(presses, signal=signal)), labels)
    assert [one.name for one in model.reader.scalars] == ["depth_mm"]
    assert {one.score.split for one in model.tested} == {"random"}
    assert model.left_out == ("split time, no scores: all labelled presses have one depth_mm, 5: press with several, "
                              "or leave the column out.",)
    with pytest.raises(ValueError, match="all labelled presses have one depth_mm, 5"):
        learn(recorded(presses), Labels(labels.touch, labels.names, np.full((60, 1), 5.0)))


def test_presses_too_few_to_test_on_and_mostly_dead_ones_are_said(tmp_path: Path) -> None:
    presses, place, _ = deep(1, 13)
    lacking = presses.signal.copy()
    lacking[[2, 5], 9:] = np.nan
    model = learn(recorded(replace(presses, signal=lacking)), labels_at(place))
    assert model.presses == 11
    assert model.tested == ()
    assert model.left_out == (
        "2 labelled frames, more than half of whose readings are dead, are left out.",
        "11 labelled presses are too few to test on as well: there are no scores. Label more of them.")
    model.save(tmp_path)
    assert surrogate.load(tmp_path).left_out == model.left_out
