"""Surrogates of a skin with an outline: made-up touches whose signals are exact multipoles of a rectangle's fields."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import eitsim
import surrogate
from eitsim.sweeps.design.design import design_from
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from surrogate.data.samples import SweepSamples
from surrogate.data.sensor_ring import radial
from surrogate.forward_map.forward_map import linearise
from surrogate.forward_map.known_places import CONVERGES
from surrogate.forward_map.load_coordinates import to_unknown
from touchcal.arrays import Array

# the foam of table 1 of the paper
CARD = MaterialCard("table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0],
                                         "longterm"), None, Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)))
Signals = Callable[[Array], Array]


@pytest.fixture(scope="module")
def samples(rectangle_samples: SweepSamples) -> SweepSamples:
    return rectangle_samples


@pytest.fixture(scope="module")
def model(rectangle_model: surrogate.Model) -> surrogate.Model:
    return rectangle_model


@pytest.mark.slow
def test_touches_far_from_edges_are_read_and_the_others_are_counted_and_left_out(
        model: surrogate.Model, samples: SweepSamples) -> None:
    found = surrogate.evaluate(model, samples)
    radius, kept = radial(samples.ring, samples.target), model.learner.reads(samples.target[:, :4])
    assert kept[~samples.near_edge & (model.rows.part == 0)].all()
    assert 0 < np.sum(~kept) <= np.sum(samples.near_edge)
    assert radius[~kept].min() > radius[kept].max()
    assert found.scores["scored"].startswith(f"{np.sum(~kept)} of {len(samples)} rows lie nearer to an edge than the "
                                             "touches that taught")
    for name, most in (("x0", 0.05), ("y0", 0.05), ("F", 0.05)):
        assert found.scores["outputs"][name]["test"]["rmse"] < most


def test_a_frame_near_an_edge_is_flagged(model: surrogate.Model, samples: SweepSamples,
                                         rectangle_signal: Signals) -> None:
    rest = samples.baseline_V[0]
    near = np.flatnonzero(~model.learner.reads(samples.target[:, :4]))
    flags = model.predict(rest + samples.signal_V[near], rest, noise_V=0.0)["flag"]
    assert all("outside the training range" in flag or "unlike the trained touches" in flag for flag in flags)
    exact = rectangle_signal(np.array([[0.0, 46.0, 10.0, 0.5], [70.0, 0.0, 10.0, 0.3]]))
    flags = model.predict(rest + exact, rest, noise_V=0.0)["flag"]
    assert all("outside the training range" in flag for flag in flags)


def test_a_kept_model_reads_the_same(model: surrogate.Model, samples: SweepSamples, tmp_path: Path) -> None:
    model.save(tmp_path / "kept")
    again, frames = surrogate.load(tmp_path / "kept"), samples.baseline_V[0] + samples.signal_V[:3]
    assert again.ring.sheet is not None
    assert again.predict(frames, noise_V=0.0).equals(model.predict(frames, noise_V=0.0))


@pytest.mark.slow
def test_a_dead_channel_and_drifting_gains_are_left_out(model: surrogate.Model, samples: SweepSamples) -> None:
    far = np.flatnonzero(radial(samples.ring, samples.target) < 0.4)[:2]
    frames = samples.baseline_V[0] + samples.signal_V[far]
    frames[:, 7] = np.nan
    found = model.predict(frames, noise_V=1e-8)
    assert np.abs(1e3 * found["x0_m"] - samples.target[far, 0]).max() < 0.3
    found = model.predict(samples.baseline_V[0] + samples.signal_V[far], noise_V=1e-8, gain_drift=1e-6)
    assert np.abs(1e3 * found["y0_m"] - samples.target[far, 1]).max() < 0.3


def test_a_touch_is_followed(model: surrogate.Model, samples: SweepSamples) -> None:
    tracker = surrogate.Tracker(model, samples.baseline_V[0], noise_V=1e-7)
    one = int(np.flatnonzero(radial(samples.ring, samples.target) < 0.4)[0])
    for _ in range(3):
        now = tracker.update(samples.baseline_V[0] + samples.signal_V[one])
    assert now.state == "touch"
    assert 1e3 * now.value[:2] == pytest.approx(samples.target[one, :2], abs=0.5)


@pytest.mark.parametrize("method", ["ridge", "gp"])
def test_methods_that_model_no_fields_learn_all_rows(samples: SweepSamples, method: str) -> None:
    model = surrogate.train(samples, method, "x0,y0,F", seed=1)
    assert surrogate.evaluate(model, samples).scores["scored"] == ""


@pytest.mark.slow
def test_a_small_sweep_of_a_rectangle_reads_unseen_touches(tmp_path: Path) -> None:
    design = design_from({"seed": 5, "body": {"outline": "rectangle", "width_mm": 120, "height_mm": 80,
                                              "thickness_mm": 5}, "electrodes": {"count": 16, "width_mm": 8},
                          "punch": {"diameter_mm": 10, "force_N": [0.02, 0.5]}, "accuracy": {"signal": 0.02}}, 60)
    eitsim.sweep(design, CARD, tmp_path, reuse=True)
    model = surrogate.train(tmp_path, outputs="x0,y0,F", seed=1)
    scores = surrogate.evaluate(model, tmp_path, noise_dB=[80], most_trained=0).scores
    noisy = scores["noise"][0]["outputs"]
    print({name: (parts["test"]["mae"], noisy[name]["test"]["mae"]) for name, parts in scores["outputs"].items()})
    for name, most, under_noise in (("x0", 0.05, 0.3), ("y0", 0.05, 0.3), ("F", 0.001, 0.003)):
        assert scores["outputs"][name]["test"]["mae"] < most
        assert noisy[name]["test"]["mae"] < under_noise


def test_what_needs_touches_far_from_edges_says_so(samples: SweepSamples) -> None:
    edge = replace(samples, near_edge=np.ones(len(samples), bool))
    with pytest.raises(ValueError, match="0 of 63 training rows are touches that no edge is near to"):
        surrogate.train(edge, outputs="x0,y0,d,F", seed=1)


@pytest.mark.slow
def test_touches_near_one_edge_are_read_and_corners_are_left_out(edge_model: surrogate.Model,
                                                                 edge_samples: SweepSamples) -> None:
    ring, touch = edge_samples.ring, edge_samples.target[:, :4]
    away = np.sort(np.array([75.0, 50.0]) - np.abs(touch[:, :2]), axis=1)
    alone = ring.radius_mm * (1 - radial(ring, touch[~edge_samples.near_edge]).max())
    room, taught = touch[:, 2] / 2 <= CONVERGES * away[:, 0], edge_model.rows.part == 0
    known = (away[:, 0] >= alone - 1e-6) | ((away[:, 1] > alone) & room)
    assert np.array_equal(edge_model.learner.reads(touch)[taught], known[taught])
    unseen = np.flatnonzero((edge_model.rows.part == 2) & edge_samples.near_edge & edge_model.learner.reads(touch))[:40]
    rest = edge_samples.baseline_V[0]
    found = edge_model.predict(rest + edge_samples.signal_V[unseen], rest, noise_V=0.0)
    off = np.column_stack([1e3 * found["x0_m"], 1e3 * found["y0_m"], found["F_N"]]) - touch[unseen][:, [0, 1, 3]]
    print("median errors near one edge:", np.median(np.abs(off), axis=0))
    assert np.all(np.median(np.abs(off), axis=0) < [0.05, 0.05, 0.05])
    held = np.mean((found["y0_lo90_m"] <= touch[unseen, 1] / 1e3) & (touch[unseen, 1] / 1e3 <= found["y0_hi90_m"]))
    assert held > 0.75
    corner = np.flatnonzero(away[:, 1] < alone - 1)[:10]
    assert len(corner) == 10
    assert all(edge_model.predict(rest + edge_samples.signal_V[corner], rest, noise_V=0.0)["flag"] != "")


@pytest.mark.slow
def test_slopes_near_an_edge_are_differences(edge_model: surrogate.Model) -> None:
    forward, h = edge_model.learner.forward, np.array([1e-4, 1e-4, 1e-5, 1e-5])  # pyright: ignore
    assert forward.near_edges is not None
    unknown = to_unknown(np.array([[10.0, 38.0, 10.0, 0.5], [-62.0, 8.0, 9.0, 0.3], [20.0, -27.0, 11.0, 0.8]]),
                         forward.p0)
    here = linearise(forward, unknown).jacobian
    for k in range(4):
        step = np.eye(4)[k] * h[k]
        slope = (linearise(forward, unknown + step).signal_V - linearise(forward, unknown - step).signal_V) / (2 * h[k])
        assert np.allclose(here[..., k], slope, atol=1e-5 * np.abs(slope).max())
