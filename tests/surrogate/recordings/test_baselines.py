"""The untouched frame: tracked between two, its drift learnt and projected out."""

import numpy as np
import pytest

from eitsim.sensors.labels import Labels, labels_of
from eitsim.sensors.recording import Recording
from surrogate.recordings.baselines import learn_drift, tracked, without
from surrogate.recordings.presses import labelled, presses_of, unmatched
from touchcal.errors import InputFileError


def test_linear_drift_is_tracked_exactly_and_held_outside() -> None:
    time = np.array([0.0, 1, 2, 5, 10, 12])
    frames = np.outer(time, [1.0, -2.0]) + 3
    untouched = np.array([False, True, False, False, True, False])
    found, age = tracked(frames, time, untouched)
    np.testing.assert_allclose(found[1:3], frames[[2, 3]])
    np.testing.assert_allclose(found[[0, 3]], frames[[1, 4]])
    np.testing.assert_array_equal(age, [1, 1, 4, 2])


def test_planted_drift_is_found_and_taken_out() -> None:
    rng = np.random.default_rng(0)
    axis = np.array([0.6, 0.8, 0, 0, 0])
    time = np.cumsum(rng.uniform(1, 3, 400))
    walk = np.cumsum(np.sqrt(np.diff(time, prepend=0)) * rng.standard_normal(400))
    drift = learn_drift(3 * walk[:, None] * axis + 0.01 * rng.standard_normal((400, 5)), time)
    assert np.linalg.norm(drift.root[0]) == pytest.approx(3, rel=0.15)
    assert abs(drift.root[0] @ axis) / np.linalg.norm(drift.root[0]) > 0.9999
    left = without(drift, 7 * axis[None] + np.eye(5)[[4]], 1)
    np.testing.assert_allclose(left, np.eye(5)[[4]], atol=1e-2)


def test_two_untouched_frames_tell_no_drift() -> None:
    assert learn_drift(np.ones((2, 5)), np.arange(2.0)).root.shape == (0, 5)


def recording(kind: str, touch: list[str]) -> Recording:
    frames = np.arange(len(touch) * 3.0).reshape(-1, 3)
    return Recording(frames, np.arange(len(touch)), None, np.array(touch, np.str_), kind, __file__)  # type: ignore


def test_signals_are_touched_less_untouched_but_differences_are_taken_as_they_are() -> None:
    voltages = presses_of(recording("voltage", ["", "a", "", "b"]))
    np.testing.assert_allclose(voltages.signal, [[0, 0, 0], [3, 3, 3]])
    np.testing.assert_array_equal(voltages.age, [1, 1])
    differences = presses_of(recording("difference", ["a", ""]))
    np.testing.assert_array_equal(differences.signal, [[0, 1, 2], [3, 4, 5]])
    assert differences.name.tolist() == ["a", ""]


@pytest.mark.parametrize(("touch", "said"), [(["a", "b"], "no frame is untouched"), (["", ""], "no frame is touched")])
def test_frames_without_a_counterpart_are_refused(touch: list[str], said: str) -> None:
    with pytest.raises(InputFileError, match=said):
        presses_of(recording("magnitude", touch))


def test_labels_meet_their_presses_by_name() -> None:
    presses = presses_of(recording("difference", ["a", "b", "c"]))
    labels = Labels(np.array(["c", "a", "z"]), ("x_mm", "y_mm"), np.array([[1.0, 2], [3, 4], [5, 6]]))
    kept, known = labelled(presses, labels, "touches.csv")
    assert kept.name.tolist() == known.touch.tolist() == ["a", "c"]
    np.testing.assert_array_equal(known.values, [[3, 4], [1, 2]])
    assert unmatched(recording("difference", ["a", "b", "", "c"]), labels) == [
        "labelled, but not in the recording: 1 of 3 touches, the first 'z'.",
        "in the recording, but without a label, so that they teach nothing: 1 of 3 touches, the first 'b'."]
    assert unmatched(recording("difference", ["a", "", "c"]), labels_of(labels, np.array([0, 1]))) == []
    with pytest.raises(ValueError, match="none of its 1 touches"):
        labelled(presses, Labels(np.array(["z"]), ("x_mm", "y_mm"), np.ones((1, 2))), "touches.csv")
