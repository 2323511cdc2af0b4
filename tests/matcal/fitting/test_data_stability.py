"""Stability of the record itself: found where it is lost, at any sampling and noise, and not found where it is not."""

import numpy as np
import pytest

from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.hyperfoam.record_stability import check_data, check_sentences
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.reduction.experiment import Experiment

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])
STABLE = Hyperfoam([8000.0, 1500.0], [6.0, -2.0], [0, 0])
ENDS = {"uniaxial": (-0.8, 0.0), "biaxial": (-0.7, 0.0), "planar": (-0.8, 0.0), "shear": (0.0, 1.0),
        "volumetric": (0.05, 1.0)}


def record(mode: str, law: Hyperfoam, points: int, noise: float, seed: int = 0) -> Experiment:
    strain = np.linspace(*ENDS[mode], points)
    stress = nominal_stress(law, mode, strain)
    scatter = noise * np.sqrt(np.mean(stress**2)) * np.random.default_rng(seed).normal(size=points)
    return Experiment(mode, strain, stress + scatter, source=(f"{mode}.csv",))


def violated(experiment: Experiment, criterion: str, nu_is_zero: bool = True) -> list[list[float]]:
    checks = check_data(weigh([experiment]), nu_is_zero)
    return next(c.violated for c in checks if c.criterion == criterion)


@pytest.mark.parametrize(("points", "noise"), [(60, 0.0), (400, 0.005), (5000, 0.01)])
def test_the_falling_plateau_of_table_1_is_found(points: int, noise: float) -> None:
    ranges = violated(record("uniaxial", TABLE_1, points, noise), "drucker")
    assert len(ranges) == 1
    np.testing.assert_allclose(ranges[0], [-0.546, -0.306], atol=0.03 if noise == 0 else 0.1)
    assert violated(record("uniaxial", TABLE_1, points, noise), "elliptic") == []


@pytest.mark.parametrize("mode", [*ENDS])
def test_a_stable_material_is_never_accused(mode: str) -> None:
    for noise in (0.0, 0.02, 0.1, 0.2):
        for seed in range(5):
            for points in (8, 60, 1000):
                checks = check_data(weigh([record(mode, STABLE, points, noise, seed)]), True)
                assert all(c.violated == [] for c in checks), (mode, noise, seed, points)


def test_a_falling_nominal_stress_is_not_elliptic_with_nu_0() -> None:
    strain = np.linspace(-0.8, 0.0, 300)
    stress = -4000 * np.tanh(-strain / 0.05) * (1 - 0.4 * np.exp(-((strain + 0.4) / 0.1) ** 2))
    snapping = Experiment("uniaxial", strain, stress, source=("snap.csv",))
    (low, high), = violated(snapping, "elliptic")
    falls = strain[np.gradient(stress, strain) < 0]
    np.testing.assert_allclose([low, high], [falls.min(), falls.max()], atol=0.02)
    checks = check_data(weigh([snapping]), True)
    assert any("the nominal stress falls" in s for s in check_sentences(checks, True))
    assert {c.criterion for c in check_data(weigh([snapping]), False)} == {"drucker"}
