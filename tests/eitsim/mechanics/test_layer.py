"""Small touches against the classical contact problem of an elastic layer bonded to a rigid base.

Solved here as a Fredholm equation of the second kind (N. N. Lebedev, Ya. S. Ufliand, J. Appl. Math. Mech. 22 (1958)
442; W. C. Hayes et al., J. Biomech. 5 (1972) 541, DOI 10.1016/0021-9290(72)90010-3): independent of
any element. Lengths are in thicknesses, stresses in E/(1 - nu^2).
"""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.scene import Body, Punch
from matcal.laws.hyperfoam import Hyperfoam

BODY = Body()


def compliance(x, nu):
    """Surface displacement of the bonded layer under a pressure of wave number x over that of the half-space."""
    k, tame = 3 - 4 * nu, np.exp(-2 * np.minimum(x, 300.0))
    return (k * (1 - tame**2) - 4 * x * tame) / (k * (1 + tame**2) + (1 + k * k + 4 * x * x) * tame)


def points(ends, count):
    """Gauss points and weights of the intervals between the ends."""
    t, w = leggauss(count)
    half, middle = np.diff(ends) / 2, (ends[1:] + ends[:-1]) / 2
    return (middle[:, None] + half[:, None] * t).ravel(), (half[:, None] * w).ravel()


def layer(contact, flat, rounding, nu, half_space=False):
    """Depth and force at which a punch, flat within a radius and rounded outside, touches a circle of radius `contact`.

    phi(t) - (2/pi) int phi(s) int (1 - L) cos(x s) cos(x t) dx ds = (depth - profile(t))/pi, F = 2 pi int phi;
    phi(contact) = 0 gives the depth.
    """
    ends = np.array([0.0, flat, contact]) if flat > 0 else np.array([0.0, contact])
    s, weight = points(ends, 40)
    t = np.append(s, contact)
    x, dx = points(np.linspace(0, 40, 41), 12)
    missing = 0.0 if half_space else (1 - compliance(x, nu)) * dx
    kernel = 2 / np.pi * (np.cos(np.outer(t, x)) * missing) @ np.cos(np.outer(x, s)) * weight
    outside = np.maximum(t, flat)
    profile = t / rounding * (np.sqrt(outside**2 - flat**2) - flat * np.arccos(flat / outside))
    system = np.eye(len(t))
    system[:, :-1] -= kernel
    unit, shaped = np.linalg.solve(system, np.column_stack([np.ones(len(t)), profile]) / np.pi).T
    depth = shaped[-1] / unit[-1]
    return depth, 2 * np.pi * weight @ (depth * unit - shaped)[:-1]


# Hayes et al., scaling factors F (1 - nu^2)/(2 E a depth) of the flat punch, by radius over thickness, to three digits.
KAPPA = {0.3: {0.2: 1.207, 0.4: 1.472, 0.6: 1.784, 1.0: 2.480}, 0.5: {0.2: 1.281, 0.4: 1.683, 0.6: 2.211, 1.0: 3.609}}


@pytest.mark.parametrize("nu", KAPPA)
def test_the_integral_equation_gives_the_published_factors(nu):
    for radius, kappa in KAPPA[nu].items():
        depth, force = layer(radius * (1 + 1e-7), radius, 1e-3, nu)
        assert force / (2 * radius * depth) == pytest.approx(kappa, rel=3e-3)


def test_the_integral_equation_gives_hertz_and_boussinesq_on_the_half_space():
    depth, force = layer(0.1, 0.0, 2.0, 0.3, half_space=True)
    assert depth == pytest.approx(0.1**2 / 2)
    assert force == pytest.approx(4 / 3 * np.sqrt(2.0) * depth**1.5)
    depth, force = layer(0.1 * (1 + 1e-6), 0.1, 1e-3, 0.3, half_space=True)
    assert force == pytest.approx(2 * 0.1 * depth, rel=1e-5)


def pressed(nu, contact, flat, rounding, element_m=0.12e-3, **keys):
    """Force and area of a touch, over the layer's at the same depth."""
    law = Hyperfoam([1e4], [2.0], [nu])
    depth, force = layer(contact, flat, rounding, nu)
    touch = solve_touch(law, BODY, Punch(force_N=None, depth_m=depth * BODY.thickness_m, **keys), element_m=element_m)
    unit = law.E_0_Pa / (1 - nu**2) * BODY.thickness_m**2
    return depth, touch.force_N / (force * unit), touch.contact_area_m2 / (np.pi * contact**2 * BODY.thickness_m**2)


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_shallow_flat_punches_press_as_on_the_elastic_layer(nu):
    """The difference vanishes with the depth, in proportion to it; extrapolated to none it is below 1e-3."""
    shallow, deep = (pressed(nu, contact, 0.5, 0.2, diameter_m=0.014, fillet_m=0.002) for contact in (0.51, 0.53))
    print("depth, force and area over the layer's", shallow, deep)
    rest = (shallow[1] * deep[0] - deep[1] * shallow[0]) / (deep[0] - shallow[0])
    assert abs(deep[1] - 1) > 3 * abs(shallow[1] - 1)
    assert rest == pytest.approx(1, abs=1e-3)
    assert shallow[2] == pytest.approx(1, abs=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_shallow_spheres_press_as_on_the_elastic_layer(nu):
    """The difference vanishes with the strain, in proportion to the contact's radius."""
    shallow, deep = (pressed(nu, contact, 0.0, 2.0, None, diameter_m=0.04, profile="sphere") for contact in (0.1, 0.2))
    print("depth, force and area over the layer's", shallow, deep)
    assert 2 * shallow[1] - deep[1] == pytest.approx(1, abs=2e-3)
    assert deep[2] == pytest.approx(1, abs=0.03)
