"""Surrogates of a skin with an outline: made-up touches whose signals are exact multipoles of a rectangle's fields."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import eitsim
import surrogate
from eitsim.electrics.forward.untouched import untouched_readings
from eitsim.scene.scene import Body, Electrodes, Scene
from eitsim.sweeps.design.design import design_from
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from surrogate.bounds.material_spread import known_material
from surrogate.data.samples import Samples
from surrogate.data.sensor_ring import Ring, place, radial, ring_of
from surrogate.forward_map import multipole_series
from surrogate.live.export_page import export_page
from surrogate.single_frame.posterior import posterior_of
from surrogate.single_frame.simulator_likelihood import Simulator, check_sensor

Array = NDArray[np.float64]

# the foam of table 1 of the paper
CARD = MaterialCard("table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0],
                                         "longterm"), None, Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)))
S, ROWS, NEAR = 6e-4, 90, 0.65  # sheet conductance, S; rows; radius from which an edge counts as near
SCENE = Scene(Body(outline="rectangle", width_m=0.15, height_m=0.1, thickness_m=0.005),
              electrodes=Electrodes(count=16, width_m=0.008))


@pytest.fixture(scope="module")
def ring() -> Ring:
    return ring_of(SCENE)


@pytest.fixture(scope="module")
def samples(ring: Ring) -> Samples:
    """Rows over the whole skin; signals of those near an edge are not multipoles."""
    rng, rest = np.random.default_rng(4), untouched_readings(SCENE, S)
    touch = np.column_stack([rng.uniform(-65, 65, ROWS), rng.uniform(-40, 40, ROWS), rng.uniform(8, 12, ROWS),
                             rng.uniform(0.1, 1.0, ROWS)])
    near = radial(ring, touch) > NEAR
    signal = signal_of(ring, touch)
    signal[near] *= 1 + 0.3 * np.sin(np.arange(signal.shape[1]))
    number = np.arange(ROWS)
    return Samples(ring, number, number, signal, np.tile(rest, (ROWS, 1)),
                   np.column_stack([touch, rng.uniform(1, 2, (ROWS, 4))]), np.full(ROWS, -1), np.empty((ROWS, 0)),
                   np.zeros(ROWS), number.astype(np.uint64), near)


def signal_of(ring: Ring, touch: Array) -> Array:
    """(n, readings) signals, V, of spots that shunt a part of the field of a circle of the punch's diameter."""
    contrast = 0.4 * touch[:, 3] / (touch[:, 3] + 0.3)
    order = np.arange(1, multipole_series.ORDERS + 1)
    radius = touch[:, 2, None] / 2 / ring.radius_mm
    strength = -1e-2 * contrast[:, None] * radius ** (2 * order) / np.array([1, 2, 12, 144, 2880])
    fields = multipole_series.patterns(ring, ring.modes, place(ring, touch))
    return multipole_series.combined(multipole_series.basis(*fields), strength)


@pytest.fixture(scope="module")
def model(samples: Samples) -> surrogate.Model:
    return surrogate.train(samples, outputs="x0,y0,d,F", seed=1)


@pytest.mark.slow
def test_touches_far_from_edges_are_read_and_the_others_are_counted_and_left_out(
        model: surrogate.Model, samples: Samples) -> None:
    found = surrogate.evaluate(model, samples)
    radius, kept = radial(samples.ring, samples.target), model.learner.reads(samples.target[:, :4])
    assert kept[~samples.near_edge & (model.rows.part == 0)].all()
    assert 0 < np.sum(~kept) <= np.sum(samples.near_edge)
    assert radius[~kept].min() > radius[kept].max()
    assert found.scores["scored"].startswith(f"{np.sum(~kept)} of {ROWS} rows lie nearer to an edge than the touches "
                                             "that taught")
    for name, most in (("x0", 0.05), ("y0", 0.05), ("F", 0.05)):
        assert found.scores["outputs"][name]["test"]["rmse"] < most


def test_a_frame_near_an_edge_is_flagged(model: surrogate.Model, samples: Samples) -> None:
    rest = samples.baseline_V[0]
    near = np.flatnonzero(~model.learner.reads(samples.target[:, :4]))
    flags = model.predict(rest + samples.signal_V[near], rest, noise_V=0.0)["flag"]
    assert all("outside the training range" in flag or "unlike the trained touches" in flag for flag in flags)
    exact = signal_of(samples.ring, np.array([[0.0, 46.0, 10.0, 0.5], [70.0, 0.0, 10.0, 0.3]]))
    flags = model.predict(rest + exact, rest, noise_V=0.0)["flag"]
    assert all("outside the training range" in flag for flag in flags)


def test_a_kept_model_reads_the_same(model: surrogate.Model, samples: Samples, tmp_path: Path) -> None:
    model.save(tmp_path / "kept")
    again, frames = surrogate.load(tmp_path / "kept"), samples.baseline_V[0] + samples.signal_V[:3]
    assert again.ring.sheet is not None
    assert again.predict(frames, noise_V=0.0).equals(model.predict(frames, noise_V=0.0))


@pytest.mark.slow
def test_a_dead_channel_and_drifting_gains_are_left_out(model: surrogate.Model, samples: Samples) -> None:
    far = np.flatnonzero(radial(samples.ring, samples.target) < 0.4)[:2]
    frames = samples.baseline_V[0] + samples.signal_V[far]
    frames[:, 7] = np.nan
    found = model.predict(frames, noise_V=1e-8)
    assert np.abs(1e3 * found["x0_m"] - samples.target[far, 0]).max() < 0.3
    found = model.predict(samples.baseline_V[0] + samples.signal_V[far], noise_V=1e-8, gain_drift=1e-6)
    assert np.abs(1e3 * found["y0_m"] - samples.target[far, 1]).max() < 0.3


def test_a_touch_is_followed(model: surrogate.Model, samples: Samples) -> None:
    tracker = surrogate.Tracker(model, samples.baseline_V[0], noise_V=1e-7)
    one = int(np.flatnonzero(radial(samples.ring, samples.target) < 0.4)[0])
    for _ in range(3):
        now = tracker.update(samples.baseline_V[0] + samples.signal_V[one])
    assert now.state == "touch"
    assert 1e3 * now.value[:2] == pytest.approx(samples.target[one, :2], abs=0.5)


@pytest.mark.parametrize("method", ["ridge", "gp"])
def test_methods_that_model_no_fields_learn_all_rows(samples: Samples, method: str) -> None:
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


def test_what_is_built_for_discs_says_so(model: surrogate.Model, samples: Samples, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="draws round skins"):
        export_page(model, tmp_path / "page.html")
    with pytest.raises(ValueError, match="sensitivities are not built for skins with an outline"):
        check_sensor(Simulator(SCENE, CARD, known_material()), model.ring)
    with pytest.raises(ValueError, match="prior of the place is built for discs"):
        posterior_of(model.learner.forward, samples.signal_V[0], 1e-6)  # pyright: ignore[reportAttributeAccessIssue]
    edge = replace(samples, near_edge=np.ones(ROWS, bool))
    with pytest.raises(ValueError, match="0 of 63 training rows are touches that no edge is near to"):
        surrogate.train(edge, outputs="x0,y0,d,F", seed=1)
