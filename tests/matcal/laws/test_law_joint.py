"""The joint of laws: what any law must satisfy, neo-Hooke by its closed forms, and a law of invariants, one class.

Truths that no law brings along: derivatives by differences, symmetry under exchange of the axes, neo-Hooke's formulas,
and the hyperfoam with one term alpha = 2 and nu = 0, which is neo-Hooke with nu = 0.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.optimize import brentq

from matcal.laws.compiled_response import energies, responses
from matcal.laws.deformation_modes import MODES, log_stretches, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.known_laws import LAWS, law_of, law_type
from matcal.laws.law import Law, differentiable, has_terms, over, scaled, vector, with_vector
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.stability import stability


def rubber(name: str, draw: np.random.Generator) -> Law:
    """A law that splits its volume off, at moduli, exponents and limits about the starts of its fit."""
    kind = law_type(name)
    size = 3 if has_terms(kind) else None
    values = [draw.uniform(0.5, 1.5, size if p.each_term else None) * (1e4 * p.start + 50 if p.name.endswith("_Pa")
                                                                       else p.start) for p in kind.parameters]
    return kind(*values[:-1], draw.uniform(0.0, 0.4999))  # pyright: ignore[reportCallIssue]


KINDS = {"hyperfoam": lambda draw: Hyperfoam(draw.uniform(1e3, 2e4, 2), [draw.uniform(-4, -0.5), draw.uniform(1, 9)],
                                             draw.uniform(-0.2, 0.45, 2)),
         "neo_hooke": lambda draw: NeoHooke(draw.uniform(1e3, 2e4), draw.uniform(-0.2, 0.48)),
         "split_volume": lambda draw: law_type("split_volume")(*draw.uniform(1e3, 2e4, 2), draw.uniform(1e4, 1e6)),
         **{name: functools.partial(rubber, name) for name in LAWS if law_type(name).keeps_volume}}
STEPS = 1e-5 * np.eye(3)


@pytest.fixture(params=[(kind, seed) for kind in KINDS for seed in range(2)], ids=str)
def drawn(request, mooney_rivlin) -> tuple[Law, np.ndarray]:
    """A law and logarithmic stretches (40, 3), among them two and three that are equal."""
    kind, seed = request.param
    draw = np.random.default_rng(seed)
    x = draw.uniform(-0.6, 0.6, (40, 3))
    x[10:20, 1], x[20:25] = x[10:20, 0], x[20:25, :1]
    return KINDS[kind](draw), x


def test_stress_and_tangent_are_derivatives_at_equal_stretches_too(drawn) -> None:
    law, x = drawn
    size = law.mu_0_Pa + law.kappa_0_Pa
    slope = np.stack([(law.energy(x + h) - law.energy(x - h)) / 2e-5 for h in STEPS], axis=-1)
    np.testing.assert_allclose(law.kirchhoff(x), slope, rtol=1e-6, atol=1e-6 * size)
    curvature = np.stack([(law.kirchhoff(x + h) - law.kirchhoff(x - h)) / 2e-5 for h in STEPS], axis=-1)
    np.testing.assert_allclose(law.tangent(x), curvature, rtol=1e-6, atol=1e-6 * size)


def test_the_divided_difference_meets_the_tangent_where_stretches_meet(drawn) -> None:
    law, x = drawn
    mean, half = (x[:, 0] + x[:, 1]) / 2, (x[:, 0] - x[:, 1]) / 2
    found, tau, tangent = law.difference(mean, half, x[:, 2]), law.kirchhoff(x), law.tangent(x)
    apart = np.abs(half) > 1e-3
    np.testing.assert_allclose(found[apart], (tau[apart, 0] - tau[apart, 1]) / (2 * half[apart]), rtol=1e-9)
    equal = half == 0
    np.testing.assert_allclose(found[equal], (tangent[:, 0, 0] - tangent[:, 0, 1])[equal], rtol=1e-12)


def test_no_axis_is_preferred_and_rest_is_free_of_stress(drawn) -> None:
    law, x = drawn
    other = [2, 0, 1]
    np.testing.assert_allclose(law.energy(x[:, other]), law.energy(x), rtol=1e-12)
    np.testing.assert_allclose(law.kirchhoff(x[:, other]), law.kirchhoff(x)[:, other], rtol=1e-10, atol=1e-9)
    assert law.energy(np.zeros(3)) == pytest.approx(0, abs=1e-9)
    assert law.kirchhoff(np.zeros(3)) == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("numba", [True, False])
def test_compiled_loops_do_what_arrays_do(drawn, numba, monkeypatch) -> None:
    monkeypatch.setattr("matcal.laws.compiled_response.compiles", lambda: numba)
    law, x = drawn
    one, other = x[:, [0, 0, 1]], x[:, [1, 2, 2]]
    mean, half = (one + other) / 2, (one - other) / 2
    tau, tangent, slope = responses(law, x, mean, half)
    size = law.mu_0_Pa + law.kappa_0_Pa
    np.testing.assert_allclose(energies(law, x), law.energy(x), rtol=1e-11, atol=1e-12 * size)
    np.testing.assert_allclose(tau, law.kirchhoff(x), rtol=1e-11, atol=1e-11 * size)
    np.testing.assert_allclose(tangent, law.tangent(x), rtol=1e-11, atol=1e-11 * size)
    np.testing.assert_allclose(slope, law.difference(mean, half, x[:, ::-1]), rtol=1e-11)
    np.testing.assert_array_equal(responses(law, x, mean[:, :1], half[:, :1])[2], slope[:, :1])


def test_moduli_at_rest_are_those_of_small_strains(drawn) -> None:
    law, _ = drawn
    small = 1e-6
    assert nominal_stress(law, "shear", small) == pytest.approx(law.mu_0_Pa * small, rel=1e-5)
    assert nominal_stress(law, "volumetric", 1 + small) == pytest.approx(law.kappa_0_Pa * small, rel=1e-5)
    assert nominal_stress(law, "uniaxial", small) == pytest.approx(law.E_0_Pa * small, rel=1e-5)


def test_moduli_scale_stresses_and_plain_numbers_make_the_law_again(drawn) -> None:
    law, x = drawn
    np.testing.assert_allclose(scaled(law, 2.5).kirchhoff(x), 2.5 * law.kirchhoff(x), rtol=1e-12)
    assert over(law, law.mu_0_Pa).mu_0_Pa == pytest.approx(1, rel=1e-12)
    one = np.linspace(0, 1e-3, vector(law).size)
    assert vector(with_vector(law, vector(law) + one)).tolist() == (vector(law) + one).tolist()
    parts = [np.ravel(getattr(law, p.name)).tolist() for p in law.parameters]
    assert vector(law_of(law.name, parts)).tolist() == vector(law).tolist()
    assert len({name for name, _ in differentiable(law)}) == len(differentiable(law))


@pytest.mark.parametrize("nu", [0.0, 0.2, 0.45])
def test_neo_hooke_has_its_closed_forms(nu) -> None:
    mu, lam = 7e3, 2 * 7e3 * nu / (1 - 2 * nu)
    law = NeoHooke(mu, nu)
    assert (law.mu_0_Pa, law.kappa_0_Pa) == pytest.approx((mu, lam + 2 * mu / 3))
    gamma = np.array([0.1, 0.8, 2.0])
    assert nominal_stress(law, "shear", gamma) == pytest.approx(mu * gamma, rel=1e-12)
    for stretch in (0.4, 0.8, 1.7):
        side = brentq(lambda t, s=stretch: mu * (t * t - 1) + lam * np.log(s * t * t), 0.3, 2, xtol=1e-15)
        expected = (mu * (stretch**2 - 1) + lam * np.log(stretch * side**2)) / stretch
        assert nominal_stress(law, "uniaxial", stretch - 1) == pytest.approx(expected, rel=1e-9)
        assert np.exp(log_stretches(law, "uniaxial", stretch - 1)[1:]) == pytest.approx([side, side], rel=1e-9)


def test_one_term_with_exponent_two_is_neo_hooke_without_lateral_strain() -> None:
    one, other = NeoHooke(9e3, 0.0), Hyperfoam([9e3], [2.0], [0.0])
    x = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    for name in ("energy", "kirchhoff", "tangent"):
        np.testing.assert_allclose(getattr(one, name)(x), getattr(other, name)(x), rtol=1e-12, atol=1e-8)
    for mode in MODES:
        strain = np.linspace(0.3, 1.8, 9) if mode == "volumetric" else np.linspace(-0.7, 0.8, 9)
        np.testing.assert_allclose(nominal_stress(one, mode, strain), nominal_stress(other, mode, strain), rtol=1e-9,
                                   atol=1e-8)


def test_neo_hooke_is_stable_where_its_curvatures_are_positive() -> None:
    """d tau_k/dx_l = 2 mu lambda_k^2 on the diagonal + lambda: positive definite wherever lambda >= 0."""
    found = stability(NeoHooke(5e3, 0.3))
    assert all(row["stable"] for modes in found.values() for row in modes.values())


@pytest.mark.parametrize(("wrong", "expected"), [
    (lambda: law_type("neohook"), "known: hyperfoam, neo_hooke"),
    (lambda: NeoHooke(np.nan, 0.1), "mu_Pa must be finite"),
    (lambda: NeoHooke(-1.0, 0.1), "mu_0 must be positive"), (lambda: NeoHooke(1.0, 0.1, "fast"), "moduli 'fast'")])
def test_what_is_no_law_is_refused(wrong, expected) -> None:
    with pytest.raises(ValueError, match=expected):
        wrong()
