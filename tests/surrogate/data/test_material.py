from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.special import ndtri

from surrogate.data import material_states
from surrogate.data.samples import SweepSamples, take
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import forward_map
from surrogate.forward_map.forward_map import linearise
from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.model.evaluate import evaluate, parts_of
from surrogate.model.model import Model
from surrogate.model.predict import columns, numbers_of, predict, prepare
from surrogate.model.train import train
from surrogate.model.trained import interval_scale
from surrogate.statistics.conformal import normal
from touchcal.arrays import Array

TOUCH = ("x0", "y0", "d", "F")
NOISE_V = 2e-5
# Stiffness of synthetic foams over the usual one: 8 % about it.
SPREAD = 0.08


def cards(count: int, seed: int) -> Array:
    """As many cards as that, evenly over their distribution, in any order."""
    return np.exp(SPREAD * np.random.default_rng(seed).permutation(ndtri((np.arange(count) + 0.5) / count)))


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory, ring: Ring, synthetic: Callable[..., tuple[Array, Array]],
          samples: SweepSamples) -> Callable[..., SweepSamples]:
    def read(count: int, seed: int, stiffness: Array) -> SweepSamples:
        number = np.arange(count) % len(stiffness)
        touch, signal = synthetic(count, seed, stiffness=stiffness[number])
        rows = pd.DataFrame({"card_sample": number, "mu_1_Pa": 8e3 * stiffness[number], "alpha_1": 8.0, "nu_1": 0.0})
        plain = np.arange(count)
        return replace(samples, ring=ring, scene=plain, group=plain, signal_V=signal,
                       baseline_V=np.tile(samples.baseline_V[0], (count, 1)),
                       target=np.column_stack([touch, np.ones((count, 4))]), card=number,
                       material=material_states.answers(rows, False, {}), signal_sd=np.zeros(count),
                       row_hash=np.arange(count, dtype=np.uint64) + 10000 * seed, near_edge=np.zeros(count, bool))

    return read


@pytest.fixture(scope="module")
def carried(drawn: Callable[..., SweepSamples]) -> Model:
    return train(drawn(100, 1, cards(40, 1)), "forward", TOUCH, seed=1)


def test_cards_that_answer_alike_are_one_direction() -> None:
    stiffness = cards(40, 0)
    rows = pd.DataFrame({"card_sample": np.arange(40), "mu_1_Pa": 8e3 * stiffness, "mu_2_Pa": 1e3 * stiffness,
                         "alpha_1": 8.0, "alpha_2": 2.0, "nu_1": 0.0, "nu_2": 0.0, "c0_S_per_m": 30.0, "a_1": -2.0,
                         "a_2": 2.0, "a_3": -1.0})
    found = material_states.answers(rows, False, {})
    state = material_states.states(material_states.fit(found), found)
    assert found.shape == (40, 10)
    assert state.shape == (40, 1)
    assert abs(np.corrcoef(state[:, 0], stiffness)[0, 1]) == pytest.approx(1.0, abs=1e-9)
    assert state.std() == pytest.approx(1.0, abs=1e-9)


def test_one_card_has_no_states(samples: SweepSamples) -> None:
    assert samples.material.shape == (200, 0)
    assert material_states.states(material_states.fit(samples.material), samples.material).shape == (200, 0)


@pytest.mark.slow
def test_the_map_knows_what_a_card_changes(ring: Ring, synthetic: Callable[..., tuple[Array, Array]]) -> None:
    state = np.random.default_rng(7).normal(size=(140, 1))
    learned = forward_map.fit(ring, *synthetic(140, 0, stiffness=np.exp(SPREAD * state[:, 0])), state)
    touch, signal = synthetic(30, 1)
    stiffer = synthetic(30, 1, stiffness=np.exp(0.01))[1]
    here = linearise(learned, to_unknown(touch, learned.p0))
    change = (stiffer - signal) / (0.01 / SPREAD)
    assert here.discrepancy.shape == (30, 208, learned.discrepancies)
    assert np.median(np.linalg.norm(here.discrepancy[..., -1] - change, axis=1) / np.linalg.norm(change, axis=1)) < 0.03
    found = invert(learned, stiffer, NOISE_V)
    assert np.all(np.linalg.eigvalsh(found.peak.joint[:, :4, :4] - found.peak.known)
                  > -1e-9 * np.trace(found.peak.joint[:, :4, :4], axis1=1, axis2=2)[:, None])
    assert np.all(np.diagonal(found.peak.noise, axis1=1, axis2=2) <= np.diagonal(found.peak.known, axis1=1, axis2=2))


@pytest.mark.slow
def test_ignoring_the_cards_breaks_coverage_and_carrying_them_restores_it(
        ring: Ring, synthetic: Callable[..., tuple[Array, Array]]) -> None:
    drawn, count = np.log(cards(40, 1)) / SPREAD, 80
    state = drawn[np.arange(126) % 40, None]
    touch, signal = synthetic(count, 9, stiffness=cards(count, 9))
    signal = signal + NOISE_V * np.random.default_rng(5).normal(size=signal.shape)
    held = {}
    for name, of, known in (("ignored", 0 * state, None), ("carried", state, state)):
        found = invert(forward_map.fit(ring, *synthetic(126, 1, stiffness=np.exp(SPREAD * of[:, 0])), known), signal,
                       NOISE_V)
        sd = np.sqrt(found.covariance[:, 3, 3])
        held[name] = float(np.mean(np.abs(found.touch[:, 3] - touch[:, 3]) < normal(0.9) * sd))
    print("part of the forces in 90 % intervals:", held)
    assert held["ignored"] < 0.7
    assert 0.83 < held["carried"] < 0.97


def test_the_force_s_deviation_has_parts_that_add_up(drawn: Callable[..., SweepSamples], carried: Model) -> None:
    unseen = drawn(6, 9, cards(6, 9))
    scores = evaluate(carried, unseen).scores
    sd = scores["force_sd"]
    assert sd["noise"] ** 2 + sd["material"] ** 2 + sd["model"] ** 2 == pytest.approx(sd["whole"] ** 2)
    assert sd["material"] > sd["model"] > sd["noise"] == 0.0
    assert "40 cards" in scores["material"]
    base = unseen.baseline_V[0]
    found = predict(prepare(carried, base, NOISE_V), base + unseen.signal_V)
    assert columns(carried)[-4:] == ["F_sd_noise_N", "F_sd_material_N", "F_sd_model_N", "flag"]
    assert numbers_of(carried, found).shape == (6, 15)
    assert np.allclose(normal(0.9) * np.sqrt(np.sum(found.force_parts**2, axis=1)), found.half_width[:, 3])
    assert np.all(found.force_parts > 0)


def test_intervals_are_calibrated_on_another_set(drawn: Callable[..., SweepSamples]) -> None:
    own, other = drawn(100, 1, np.ones(1)), drawn(60, 5, np.ones(1))
    other = replace(other, signal_V=1.01 * other.signal_V)
    used, apart = take(other, np.arange(40)), take(other, np.arange(40, 60))
    calibrated = train(own, "forward", TOUCH, calibrate=used)
    assert interval_scale(calibrated).factor[0, 3] > 2 * normal(0.9)
    assert evaluate(calibrated, apart).scores["outputs"]["F"]["all"]["coverage_90"] > 0.7
    assert set(parts_of(calibrated, used)) == {"val"}
    with pytest.raises(ValueError, match="100 of the calibrating rows are rows of the training set too"):
        train(own, "forward", TOUCH, calibrate=own)
    with pytest.raises(ValueError, match="10 calibrating rows are too few"):
        train(own, "forward", TOUCH, calibrate=take(used, np.arange(10)))
