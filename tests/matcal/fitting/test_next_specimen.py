"""The next specimen: synthetic specimens whose scatter is known, in stiffness and in shape."""

import numpy as np
import pytest

import matcal
from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.hyperfoam.next_specimen import next_specimens
from matcal.laws.deformation_modes import nominal_stress
from matcal.reduction.experiment import Experiment

LAW = matcal.Hyperfoam([2e4, 4e3], [9.0, -3.0], [0.0, 0.0])
STRAIN = np.linspace(-0.01, -0.6, 80)


def specimen(rng: np.random.Generator, stiffness: float, shape: float) -> Experiment:
    """ln stress over that of LAW: normal, with a slope over strain that is normal too; readings of 0.5 % noise."""
    d = stiffness * rng.normal() + shape * rng.normal() * (2 * STRAIN / STRAIN[-1] - 1)
    stress = nominal_stress(LAW, "uniaxial", STRAIN) * np.exp(d)
    return Experiment("uniaxial", STRAIN, stress * (1 + 0.005 * rng.normal(size=STRAIN.size)))


@pytest.mark.parametrize(("count", "stiffness", "shape"), [(4, 0.1, 0.0), (6, 0.08, 0.05), (10, 0.05, 0.1)])
def test_the_next_specimen_lies_in_its_interval(count: int, stiffness: float, shape: float) -> None:
    """50 sets of specimens, each with 20 further ones that were not fitted: 95 % of their stresses."""
    rng, inside, left_out = np.random.default_rng(count), [], []
    other = matcal.Hyperfoam([3e4], [6.0], [0.0])  # whatever law the records are compared with
    for _ in range(50):
        (found,) = next_specimens(weigh([specimen(rng, stiffness, shape) for _ in range(count)]), other)
        for one in (specimen(rng, stiffness, shape) for _ in range(20)):
            off = np.log(np.interp(-found.strain, -STRAIN, one.value) / found.stress_Pa)
            inside.append(np.mean(np.abs(off) <= found.further))
        left_out += [*found.held.values()]
    assert 0.90 < np.mean(inside) < 0.98
    assert abs(np.mean(left_out) - np.mean(inside)) < 0.04


def test_the_mean_is_known_better_and_the_law_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    tests = [specimen(rng, 0.1, 0.03) for _ in range(5)]
    one, other = (next_specimens(weigh(tests), law)[0] for law in (LAW, matcal.Hyperfoam([3e4], [6.0], [0.0])))
    assert one.mean == pytest.approx(one.further / np.sqrt(6))
    assert one.further == pytest.approx(other.further, rel=0.02)
    np.testing.assert_allclose(one.stress_Pa, other.stress_Pa, rtol=0.03)
    assert set(one.held) == {f"uniaxial_{k}" for k in range(1, 6)}


def test_an_odd_specimen_is_not_held_by_the_others() -> None:
    rng = np.random.default_rng(2)
    tests = [specimen(rng, 0.03, 0.0) for _ in range(5)]
    odd = Experiment("uniaxial", STRAIN, 1.6 * nominal_stress(LAW, "uniaxial", STRAIN))
    (found,) = next_specimens(weigh([*tests, odd]), LAW)
    assert found.held["uniaxial_6"] == 0
    assert min(share for label, share in found.held.items() if label != "uniaxial_6") == 1


def test_one_of_a_kind_says_nothing_and_kinds_teach_each_other() -> None:
    rng = np.random.default_rng(1)
    assert next_specimens(weigh([specimen(rng, 0.1, 0.0)]), LAW) == ()
    two = [specimen(rng, 0.05, 0.0) for _ in range(2)]
    (alone,) = next_specimens(weigh(two), LAW)
    assert not alone.held
    sheared = [Experiment("shear", -STRAIN, k * nominal_stress(LAW, "shear", -STRAIN)) for k in (0.97, 1.0, 1.04)]
    together = next_specimens(weigh([*two, *sheared]), LAW)
    assert [found.kind for found in together] == ["uniaxial", "shear"]
    assert together[0].further < alone.further
    assert len(together[0].held) == 2
