"""Designs: a row depends on seed and index alone, ranges and distributions are met, mistakes are named."""

import math

import numpy as np
import pytest

from eitsim.sweeps.design.design import Design, design_from, scene_at

RANGES = {"scenes": 64, "seed": 7, "punch": {"diameter_mm": {"choice": [12, 14]}, "force_N": [0.2, 1.5]}}


def forces(design: Design) -> list[float]:
    return [scene_at(design, i).punches[0].force_N or 0.0 for i in range(design.scenes)]


def test_random_rows_do_not_depend_on_the_count() -> None:
    assert forces(design_from(RANGES, 10)) == forces(design_from(RANGES))[:10]
    assert forces(design_from(RANGES | {"seed": 8})) != forces(design_from(RANGES))


def test_places_are_uniform_over_the_disc_where_the_punch_fits() -> None:
    design = design_from(RANGES, 2000)
    punches = [scene_at(design, i).punches[0] for i in range(2000)]
    reach = np.array([math.hypot(p.x_m, p.y_m) / (0.1 - p.diameter_m / 2) for p in punches])
    assert reach.max() <= 1
    assert np.mean(reach**2 < 0.5) == pytest.approx(0.5, abs=4 * math.sqrt(0.25 / 2000))


@pytest.mark.parametrize("sampler", ["lhs", "sobol"])
def test_space_filling_samplers_stratify(sampler: str) -> None:
    design = design_from(RANGES | {"sampler": sampler})
    cells = np.floor((np.array(forces(design)) - 0.2) / 1.3 * 64).astype(int)
    assert len(set(cells)) == 64


@pytest.mark.parametrize("dist", ["normal", "lognormal"])
def test_distributions_have_their_moments(dist: str) -> None:
    raw = {"scenes": 1024, "sampler": "sobol", "punch": {"force_N": {"dist": dist, "mean": 1.0, "sd": 0.2}}}
    drawn = forces(design_from(raw))
    assert np.mean(drawn) == pytest.approx(1.0, abs=0.005)
    assert np.std(drawn) == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize(("raw", "named"), [
    ({}, "scenes"), ({"scenes": 0}, "scenes"), ({"scenes": 3, "sampler": "grid"}, "random, lhs, sobol"),
    ({"scenes": 3, "punch": {"force_N": [1, 2, 3]}}, "force_N"), ({"scenes": 3, "punch": {"size": 1}}, "size"),
    ({"scenes": 3, "punch": {"force_N": {"dist": "cauchy"}}}, "force_N"), ({"scenes": 3, "noise": {}}, "noise"),
    ({"scenes": 3, "measurement": {"noise": 1}}, "known: seed, noise_V")])
def test_mistakes_are_named(raw: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        design_from(raw)
