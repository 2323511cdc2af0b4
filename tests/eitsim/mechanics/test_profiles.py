"""Profiles of punches: an ellipse between flat and sphere, and a profile that is one class and one line of registry."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from scipy.spatial import KDTree

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.profiles import registry
from eitsim.scene.profiles.ellipse import Ellipse
from eitsim.scene.profiles.profile import SignedDistance
from eitsim.scene.profiles.rounded_cone import Sphere
from eitsim.scene.scene import Body, Punch, check_value, scene_from
from eitsim.simulation.reuse import scene_shape
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "instantaneous")
CARD = MaterialCard("Table 1", FOAM, None, Conductivity(30.0, [-2, 2, -1], (0.0, 0.4)))
COARSE_M = 0.24e-3


def points(radius: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    return rng.uniform(0, 1.3 * radius, 2000), rng.uniform(-0.5 * radius, 1.5 * radius, 2000)


def test_an_ellipse_as_high_as_wide_is_a_hemisphere() -> None:
    r, y = points(0.7)
    ellipse, sphere = Ellipse.of(0.7, 0.7, 0.0), Sphere.of(0.7, 0.1, 0.0)
    for one, other in zip(ellipse.signed_distance(r, y), sphere.signed_distance(r, y), strict=True):
        np.testing.assert_allclose(np.asarray(one, float), other, rtol=0, atol=1e-11)
    np.testing.assert_allclose(ellipse.arc_length(r, y), sphere.arc_length(r, y), atol=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize("fillet", [0.02, 0.1, 0.4])
def test_distance_and_arc_of_an_ellipse_are_those_of_a_fine_polygon(fillet: float) -> None:
    ellipse = Ellipse.of(0.7, fillet, 0.0)
    r, y = (x[points(0.7)[1] < ellipse.height] for x in points(0.7))
    t = np.linspace(0, np.pi / 2, 200_001)
    outline = np.column_stack([0.7 * np.sin(t), ellipse.height * (1 - np.cos(t))])
    distance, nearest = KDTree(outline, balanced_tree=False).query(np.column_stack([r, y]))
    inside = (r / 0.7) ** 2 + (1 - y / ellipse.height) ** 2 < 1
    at = ellipse.signed_distance(r, y)
    np.testing.assert_allclose(at.penetration, np.where(inside, distance, -distance), atol=1e-8)
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(outline, axis=0).T)))
    np.testing.assert_allclose(ellipse.arc_length(r, y), length[nearest], atol=1e-5)
    h, near = 1e-5, (np.abs(at.penetration) < fillet / 2) & (r > 2e-5) & (y < 0.9 * ellipse.height)
    ahead, behind = (ellipse.signed_distance(r + s * at.normal_y, y - s * at.normal_r).penetration for s in (h, -h))
    np.testing.assert_allclose(((2 * at.penetration - ahead - behind) / h**2)[near], at.curvature[near], rtol=1e-3,
                               atol=1e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("friction", ["none", "stick"])
def test_a_touch_of_an_ellipse_has_the_hemisphere_as_its_limit(friction: str) -> None:
    sphere = Punch(diameter_m=0.01, force_N=0.3, profile="sphere", friction=friction)
    ellipse, flatter = (replace(sphere, profile="ellipse", fillet_m=f) for f in (0.005, 0.002))
    ball, dome, lens = (solve_touch(FOAM, Body(), p, element_m=COARSE_M) for p in (sphere, ellipse, flatter))
    assert dome.depth_m == pytest.approx(ball.depth_m, rel=1e-9)
    np.testing.assert_allclose(dome.stretch_normal, ball.stretch_normal, rtol=1e-7)
    np.testing.assert_allclose(dome.pressure_Pa, ball.pressure_Pa, rtol=1e-6, atol=1e-6 * ball.sigma_max_Pa)
    assert lens.depth_m < 0.9 * ball.depth_m
    flat = solve_touch(FOAM, Body(), replace(sphere, profile="flat"), element_m=COARSE_M)
    assert flat.depth_m < lens.depth_m


@dataclass(frozen=True)
class Ball:
    """A hemisphere by formulas of its own."""

    is_flat: ClassVar[bool] = False
    sharp_tip: ClassVar[bool] = False
    default_penalty: ClassVar[float] = 525.0
    radius: float

    @classmethod
    def of(cls, radius: float, fillet: float, half_angle_rad: float) -> Ball:
        return cls(radius)

    @property
    def edge_radius(self) -> float:
        return self.radius

    def with_edge(self, edge_radius: float) -> Ball:
        return self

    def signed_distance(self, r: np.ndarray, y: np.ndarray) -> SignedDistance:
        wall, up = y >= self.radius, np.minimum(y, self.radius) - self.radius
        away = np.sqrt(r**2 + up**2)
        return SignedDistance(self.radius - away, -r / away, -up / away, np.where(wall, 0.0, 1 / away), wall)

    def arc_length(self, r: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.radius * np.arctan2(r, np.maximum(self.radius - y, 0.0)) + np.maximum(y - self.radius, 0.0)


def test_a_new_profile_is_a_class_and_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the scene file to the readings, and refused by name where a capability is lacking."""
    with pytest.raises(ValueError, match="'ball' is unknown; known: flat, sphere, cone, ellipse"):
        scene_from({"punch": {"profile": "ball"}})
    monkeypatch.setitem(registry._BUILT_IN, "ball", Ball)
    check_value("punch", "profile", "ball")
    scenes = {word: scene_from({"punch": {"profile": word, "force_N": 0.2}, "accuracy": {"signal": 0.05}})
              for word in ("ball", "sphere")}
    ball, sphere = (simulate(scene, CARD) for scene in scenes.values())
    assert ball.outcome == sphere.outcome == "ok"
    assert ball.touches[0].depth_m == pytest.approx(sphere.touches[0].depth_m, rel=1e-9)
    scale = np.abs(sphere.readings.signal_V).max()
    np.testing.assert_allclose(ball.readings.signal_V, sphere.readings.signal_V, atol=1e-8 * scale)
    with pytest.raises(ValueError, match=r'profile = "ball".*flat punches only'):
        scene_shape(scenes["ball"], CARD)
