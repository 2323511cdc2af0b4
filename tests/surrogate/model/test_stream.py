import io
import os
import re
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import surrogate
from eitsim.scene.drive import voltage_columns
from surrogate.cli import main
from surrogate.data.frame_rows import BATCH, read_lines, sound_lines, waiting_lines
from surrogate.data.samples import SweepSamples
from surrogate.model.model import Model
from surrogate.model.predict import lost_words, predict, prepare, read_touches, table_of
from surrogate.model.stream import answer
from surrogate.model.tracking.tracked_stream import track
from surrogate.model.train import train
from touchcal.arrays import Array
from touchcal.errors import InputFileError

Synthetic = Callable[[int, int], tuple[Array, Array]]


@pytest.fixture(scope="module")
def ridge(samples: SweepSamples) -> Model:
    return train(samples, "ridge", ("x0", "F"), 1)


def as_lines(frames: Array) -> list[str]:
    return [",".join(f"{volt!r}" for volt in frame) for frame in frames.tolist()]


def answered(model: Model, text: str, baseline_V: Array | None = None) -> pd.DataFrame:
    sink = io.StringIO()
    counts = answer(model, io.BytesIO(text.encode()), sink, 0.0, baseline_V)
    table = pd.read_csv(io.StringIO(sink.getvalue()), keep_default_na=False, na_values=[""], dtype={"flag": str})
    assert counts.answered == len(table)
    return table.assign(flag=table["flag"].fillna(""))


def test_a_stream_answers_as_a_file_does(ridge: Model, synthetic: Synthetic, untouched_V: Array) -> None:
    frames = untouched_V + synthetic(3 * BATCH, 60)[1]
    lines = as_lines(np.vstack([untouched_V, frames]))
    found = predict(prepare(ridge, untouched_V), frames)
    for text in ("\n".join(lines), "\r\n".join([",".join(voltage_columns(208)), *lines, ""])):
        table = answered(ridge, text)
        assert np.allclose(table[["x0_mm", "F_N"]], found.value, rtol=1e-5)
        assert table["line"].tolist() == list(range(len(lines) - len(frames) + ("v_000" in text) + 1,
                                                    len(lines) + ("v_000" in text) + 1))


def test_named_columns_may_come_in_any_order(ridge: Model, synthetic: Synthetic, untouched_V: Array) -> None:
    order = np.random.default_rng(0).permutation(208)
    frames = untouched_V + synthetic(2, 61)[1]
    mixed = "\n".join([",".join(voltage_columns(208)[i] for i in order), *as_lines(frames[:, order])])
    straight = answered(ridge, "\n".join(as_lines(frames)), untouched_V)
    assert np.allclose(answered(ridge, mixed, untouched_V)[["x0_mm", "F_N"]], straight[["x0_mm", "F_N"]])


def test_a_bad_line_is_flagged_and_does_not_end_the_stream(ridge: Model, synthetic: Synthetic,
                                                           untouched_V: Array) -> None:
    good = as_lines(untouched_V + synthetic(2, 62)[1])
    cells = good[0].split(",")
    bad = ["1,2,3", ",".join(["volts", *cells[1:]]), ",".join([*cells[:5], "", *cells[6:]]), "", "\xff\xfe"]
    table = answered(ridge, "\n".join([good[0], *bad, good[1]]), untouched_V)
    assert table["line"].tolist() == [1, 2, 3, 4, 6, 7]
    assert table["x0_mm"].notna().tolist() == [True, False, False, True, False, True]
    flags = table["flag"].astype(str).tolist()
    assert flags[1:3] == ["unreadable: 3 columns, expected 208 voltages separated by commas",
                          "unreadable: column 1 holds 'volts' and no number"]
    assert flags[3] == ""
    assert flags[4].startswith("unreadable: 1 columns")


def test_other_columns_of_a_recording_cost_nothing(ridge: Model, synthetic: Synthetic, untouched_V: Array,
                                                   tmp_path: Path) -> None:
    lines = as_lines(untouched_V + synthetic(2, 63)[1])
    names = ["index", *voltage_columns(208), "touch"]
    text = "\n".join([",".join(names), *(f"{k},{line},thumb" for k, line in enumerate(lines))])
    one, other = (answered(ridge, lone, untouched_V)[["x0_mm", "F_N"]] for lone in (text, "\n".join(lines)))
    assert np.allclose(one, other)
    (tmp_path / "frames.csv").write_text(text)
    assert read_lines(tmp_path / "frames.csv", 208).line.tolist() == [2, 3]


def test_a_header_of_other_names_is_refused(ridge: Model, untouched_V: Array, tmp_path: Path) -> None:
    names = voltage_columns(208)
    for spoilt, message in ((["time", *names], "line 1: the header names 'time' in column 1, which is no reading"),
                            ([*names[:207], "v_208"], "names 'v_208' in column 208.*v_000 to v_207, or leave the"),
                            (names[:207], "the header lacks v_207")):
        text = "\n".join([",".join(spoilt), *as_lines(untouched_V[None])])
        with pytest.raises(ValueError, match=message):
            answered(ridge, text, untouched_V)
        (tmp_path / "frames.csv").write_text(text)
        with pytest.raises(InputFileError, match=message):
            read_lines(tmp_path / "frames.csv", 208)


def test_a_file_and_a_stream_read_the_same_of_bad_lines(ridge: Model, synthetic: Synthetic, untouched_V: Array,
                                                        tmp_path: Path) -> None:
    """One bad frame costs no other."""
    good = as_lines(untouched_V + synthetic(3, 64)[1])
    cells = good[0].split(",")
    odd = [",".join([*cells[:5], cell, *cells[6:]]) for cell in ("", "inf", "0", "volts")]
    text = "\n".join([good[0], "1,2,3", *odd[:2], "", *odd[2:], *good[1:]])
    (tmp_path / "frames.csv").write_text(text)
    lines = read_lines(tmp_path / "frames.csv", 208)
    table = table_of(ridge, lines, read_touches(prepare(ridge, untouched_V), lines))
    streamed = answered(ridge, text, untouched_V)
    assert table["line"].tolist() == [1, 2, 3, 4, 6, 7, 8, 9]
    assert table["flag"].tolist() == streamed["flag"].tolist()
    assert [flag[:12] for flag in table["flag"]] == ["", "unreadable: ", *[""] * 3, "unreadable: ", "", ""]
    assert table["x0_mm"].notna().tolist() == [not flag.startswith("unreadable") for flag in table["flag"]]
    assert np.allclose(table["x0_mm"], streamed["x0_mm"], equal_nan=True, rtol=1e-4)


def test_what_a_dead_channel_costs_is_said_once_and_no_frame_is_flagged(ridge: Model, synthetic: Synthetic,
                                                                        untouched_V: Array) -> None:
    """Of a channel that dies in a stream, from its second frame without it on; of a file, before its rows."""
    frames = untouched_V + synthetic(6, 66)[1]
    frames[2:, 7] = np.nan
    said: list[str] = []
    sink = io.StringIO()
    answer(ridge, io.BytesIO("\n".join(as_lines(frames)).encode()), sink, 1e-6, untouched_V, say=said.append)
    with pytest.warns(UserWarning, match="in 4 of 6 frames v_007 is dead and left out, and intervals are wider for it; "
                                         "mean error by the validation rows: x0 about ") as warned:
        table = ridge.predict(frames, untouched_V, noise_V=1e-6)
    (words,) = said
    assert words.startswith("v_007 is dead and left out, and intervals are wider")
    assert f"{words}" in str(warned[0].message)
    without, whole = (float(word) for word in re.findall(r"x0 about (\S+) mm without, (\S+) with", words)[0])
    print(words)
    assert 0 < whole < 1.5 * without
    assert list(table["flag"]) == [""] * 6 == answered(ridge, "\n".join(as_lines(frames)), untouched_V)["flag"].tolist()


def test_a_dead_channel_is_named_as_the_header_names_it(ridge: Model, synthetic: Synthetic, untouched_V: Array,
                                                        tmp_path: Path) -> None:
    """In a stream whose columns are in another order, in a file, and by a tracker."""
    frames = untouched_V + synthetic(4, 68)[1]
    frames[1:, 7] = np.nan
    header = ",".join(f"pin {number}" for number in reversed(range(1, 209)))
    text = "\n".join([header, *as_lines(frames[:, ::-1])])
    said: list[str] = []
    answer(ridge, io.BytesIO(text.encode()), io.StringIO(), 1e-6, untouched_V, say=said.append)
    assert said[0].startswith("pin 8 is dead and left out")
    (tmp_path / "frames.csv").write_text(text)
    lines = read_lines(tmp_path / "frames.csv", 208)
    assert lost_words(prepare(ridge, untouched_V), lines.volts, lines.columns).startswith(
        "in 3 of 4 frames pin 8 is dead and left out")
    assert read_lines(tmp_path / "frames.csv", 208).after_first().columns[:2] == ("pin 1", "pin 2")
    tracker = surrogate.Tracker(ridge, untouched_V, 1e-6, say=said.append)
    track(tracker, io.BytesIO(text.encode()), io.StringIO(), said.append)
    assert any(words.startswith("pin 8 is dead and left out") for words in said[1:])


def test_a_channel_that_sticks_from_some_line_on_is_left_out(ridge: Model, synthetic: Synthetic,
                                                            untouched_V: Array) -> None:
    """In a file from there on; in a stream once chance is unlikely, also from the first line on, and what that costs is
    said."""
    frames = untouched_V + synthetic(40, 67)[1]
    stuck, lost = frames.copy(), frames.copy()
    stuck[20:, 7], lost[20:, 7] = stuck[20, 7], np.nan
    with pytest.warns(UserWarning, match="in 20 of 40 frames v_007 is dead and left out"):
        found, known = (ridge.predict(one, untouched_V, noise_V=1e-6) for one in (stuck, lost))
    pd.testing.assert_frame_equal(found, known)
    said: list[str] = []
    sink = io.StringIO()
    answer(ridge, io.BytesIO("\n".join(as_lines(stuck)).encode()), sink, 0.0, untouched_V, say=said.append)
    streamed = pd.read_csv(io.StringIO(sink.getvalue()))
    left_out = answered(ridge, "\n".join(as_lines(lost)), untouched_V)
    assert np.allclose(streamed["x0_mm"][30:], left_out["x0_mm"][30:], rtol=1e-4)
    assert [words.split(",")[0] for words in said] == ["v_007 is dead and left out"]
    stuck[:, 7], lost[:, 7] = untouched_V[7], np.nan
    streamed, left_out = (answered(ridge, "\n".join(as_lines(one)), untouched_V) for one in (stuck, lost))
    assert not np.allclose(streamed["x0_mm"][:5], left_out["x0_mm"][:5], rtol=1e-4)
    assert np.allclose(streamed["x0_mm"][20:], left_out["x0_mm"][20:], rtol=1e-4)


def test_the_first_line_is_said_to_be_taken_as_untouched(ridge: Model, synthetic: Synthetic, untouched_V: Array
                                                         ) -> None:
    said: list[str] = []
    text = "\n".join(as_lines(untouched_V + np.vstack([np.zeros(208), -synthetic(2, 65)[1]])))
    answer(ridge, io.BytesIO(text.encode()), io.StringIO(), 0.0, say=said.append)
    assert said[0].startswith("the input, line 1 is taken as the untouched frame; give --baseline FILE")
    assert len(said) == 2
    assert said[1].startswith("line 2 on: 1 of 1 frames differ from the untouched one with the other sign")


def test_without_an_untouched_frame_there_is_no_stream(ridge: Model) -> None:
    with pytest.raises(ValueError, match=r"the input held no frame. Give the untouched one first"):
        answered(ridge, "\n\n")
    with pytest.raises(ValueError, match=r"the input, line 1: unreadable: 2 columns, expected 208 .* first frame"):
        answered(ridge, "1,2\n")


def test_lines_come_as_they_are_there() -> None:
    """Half a line waits for its end; whole ones do not wait for others, and no more are taken than fit."""
    read, write = os.pipe()
    with open(read, "rb") as source:
        lines = waiting_lines(source, most=2)
        os.write(write, b"a\nb")
        assert next(lines) == [(1, "a")]
        os.write(write, b"b\nc\nd\ne\n")
        assert [next(lines), next(lines)] == [[(2, "bb"), (3, "c")], [(4, "d"), (5, "e")]]
        os.write(write, b"end")
        os.close(write)
        assert list(lines) == [[(6, "end")]]


def test_the_command_answers_a_line_before_the_next_one(ridge: Model, synthetic: Synthetic, untouched_V: Array,
                                                        tmp_path_factory: pytest.TempPathFactory,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path_factory.mktemp("ridge") / "model"
    ridge.save(folder)
    lines = as_lines(np.vstack([untouched_V, untouched_V + synthetic(2, 63)[1]]))
    (frames_in, to_frames), (answers_in, to_answers) = os.pipe(), os.pipe()

    def talk() -> list[str]:
        heard = []
        with open(answers_in) as answers, open(to_frames, "w") as frames:
            frames.write(lines[0] + "\n")
            frames.flush()
            heard.append(answers.readline())
            for line in lines[1:]:
                frames.write(line + "\n")
                frames.flush()
                heard.append(answers.readline())
        return heard

    heard: list[str] = []
    other_end = threading.Thread(target=lambda: heard.extend(talk()))
    monkeypatch.setattr("sys.argv", ["surrogate", "predict", str(folder), "-", "--noise-V", "1e-6"])
    with open(frames_in) as stdin, open(to_answers, "w") as stdout:
        monkeypatch.setattr("sys.stdin", stdin)
        monkeypatch.setattr("sys.stdout", stdout)
        other_end.start()
        with pytest.raises(SystemExit) as end:
            main.main()
    other_end.join(10)
    assert not end.value.code
    assert heard[0].startswith("line,x0_mm")
    assert [line.split(",")[0] for line in heard[1:]] == ["2", "3"]


def test_frames_of_a_board_s_file_are_read_by_their_numbers(tmp_path: Path) -> None:
    volts = np.random.default_rng(0).normal(size=(3, 208))
    volts[1, 5] = np.nan
    np.save(tmp_path / "frames.npy", volts)
    found = read_lines(tmp_path / "frames.npy", 208)
    np.testing.assert_array_equal(found.volts, volts)
    assert (found.line.tolist(), found.problem) == ([1, 2, 3], ["", "", ""])


@pytest.mark.parametrize(("text", "line"), [("1,2\n1,2,3\n", 1), ("1,2,3\n\n1,2,x\n", 3)], ids=["first", "later"])
def test_a_file_of_untouched_frames_is_refused_by_its_first_line_that_is_none(tmp_path: Path, text: str, line: int
                                                                              ) -> None:
    (tmp_path / "untouched.csv").write_text(text)
    with pytest.raises(InputFileError, match=rf"untouched.csv.*line {line}: unreadable: .*leave the line out"):
        sound_lines(tmp_path / "untouched.csv", 3)
