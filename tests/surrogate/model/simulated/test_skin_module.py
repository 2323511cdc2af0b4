"""The module for robot simulators: the map's numbers in either precision, derivatives, several contacts, noise."""

import runpy
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import surrogate
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import forward_map
from surrogate.forward_map.map_arrays import map_arrays
from touchcal.arrays import Array

torch = pytest.importorskip("torch")
HALF = torch.tensor([0.02, -0.01, 0.013, 0.7], dtype=torch.float64)


@pytest.fixture(scope="module")
def known(ring: Ring, synthetic: Callable[..., tuple[Array, Array]], untouched_V: Array) -> surrogate.TouchMap:
    learned = forward_map.fit(ring, *synthetic(60, 1, reach_mm=40.0))
    return surrogate.TouchMap(map_arrays(learned), ring, untouched_V, learned.bounds, learned.known_mm)


@pytest.fixture(scope="module")
def touches(synthetic: Callable[..., tuple[Array, Array]]) -> torch.Tensor:
    return torch.tensor(synthetic(300, 4, reach_mm=40.0)[0] / [1e3, 1e3, 1e3, 1])


def test_both_precisions_give_the_maps_signals(known: surrogate.TouchMap, touches: torch.Tensor) -> None:
    signal = known.signals((touches * torch.tensor([1e3, 1e3, 1e3, 1])).numpy())
    size = np.linalg.norm(signal, axis=1)
    for dtype, most in ((torch.float64, 1e-10), (torch.float32, 1e-4)):
        found = surrogate.Skin(known, dtype=dtype).signal(touches[:, None].to(dtype)).double().numpy()
        assert np.max(np.linalg.norm(found - signal, axis=1) / size) < most


def test_derivatives_are_those_of_differences(known: surrogate.TouchMap, touches: torch.Tensor) -> None:
    skin, weight = surrogate.Skin(known, dtype=torch.float64), torch.randn(208, dtype=torch.float64)
    at = touches[:20, None].clone().requires_grad_()
    (skin.signal(at) @ weight).sum().backward()
    for q, step in enumerate((1e-6, 1e-6, 1e-6, 1e-4)):
        move = step * torch.eye(4, dtype=torch.float64)[q]
        slope = (skin.signal(at.detach() + move) - skin.signal(at.detach() - move)) @ weight / (2 * step)
        assert torch.allclose(at.grad[:, 0, q], slope, rtol=1e-3, atol=1e-6 * float(slope.abs().max()))


def test_contacts_add_up_and_none_is_nothing(known: surrogate.TouchMap, touches: torch.Tensor) -> None:
    skin = surrogate.Skin(known, dtype=torch.float64)
    pair = torch.stack([touches[:5], touches[5:10]], 1)
    assert torch.allclose(skin.signal(pair), skin.signal(pair[:, :1]) + skin.signal(pair[:, 1:]))
    light = torch.cat([HALF[:3], torch.zeros(1, dtype=torch.float64)])[None, None].requires_grad_()
    skin(light, noisy=False).sum().backward()
    assert torch.equal(skin(light, noisy=False)[0], skin.untouched_V)
    assert torch.isfinite(light.grad).all()
    assert skin.inside(HALF[None]).all()
    assert not skin.inside(HALF[None] * 5).any()


def test_noise_is_that_of_the_sensors_untouched_frames(known: surrogate.TouchMap) -> None:
    rng = np.random.default_rng(0)
    common = 2e-3 * rng.normal(size=(400, 1)) * np.ones(208)
    frames = 1.01 * known.baseline_V + common + 1e-3 * rng.normal(size=(400, 208))
    skin = surrogate.Skin(known, untouched_V=frames, dtype=torch.float64)
    drawn = skin(HALF.expand(3000, 1, 4), generator=torch.Generator().manual_seed(1))
    off = drawn - skin(HALF.expand(1, 1, 4), noisy=False)
    assert float(off.std()) == pytest.approx(np.hypot(2e-3, 1e-3), rel=0.1)
    assert float(off.mean(1).std()) == pytest.approx(2e-3, rel=0.1)
    assert np.allclose(skin.untouched_V, frames.mean(axis=0))


@pytest.mark.parametrize(("given", "says"), [
    ({"turned_rad": [0.1] * 3}, "turned_rad must hold 16 angles"),
    ({"untouched_V": np.zeros((2, 5))}, r"finite frames \(n, 208\)")])
def test_what_does_not_fit_the_sensor_is_refused(given: dict[str, Any], says: str,
                                                 known: surrogate.TouchMap) -> None:
    with pytest.raises(ValueError, match=says):
        surrogate.Skin(known, **given)


def example(name: str) -> dict[str, Any]:
    return runpy.run_path(str(Path(__file__).parents[4] / "examples" / name))


def test_contacts_of_two_simulators_are_places_on_the_skin() -> None:
    """A skin turned by a quarter about z and moved: two points of one body, 1 and 3 N, and a point that bears none."""
    origin, turn = np.array([1.0, 2.0, 3.0]), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    points, force = [origin + turn @ [0.01, 0.0, 0.005], origin + turn @ [0.03, 0.0, 0.005], origin], [1.0, 3.0, 0.0]
    right = [[0.025, 0.0, 0.012, 4.0], *[[0.0, 0.0, 0.01, 0.0]] * 3]
    contact = [SimpleNamespace(geom1=7, geom2=5, pos=points[0]), SimpleNamespace(geom1=5, geom2=7, pos=points[1]),
               SimpleNamespace(geom1=7, geom2=6, pos=points[2])]
    data = SimpleNamespace(contact=contact, ncon=3, geom_xpos={7: origin}, geom_xmat={7: turn.ravel()})
    found = example("mujoco_skin.py")["contacts_of"](data, 7, {5: 0.012, 6: 0.01}, lambda i: np.array([force[i], 9.0]))
    assert np.allclose(found, right)
    tuples = [(0, 0, body, -1, -1, place, place, (0, 0, 1), 0.0, one)
              for body, place, one in zip((5, 5, 6), points, force, strict=True)]
    assert np.allclose(example("pybullet_skin.py")["contacts_of"](tuples, origin, turn.ravel(), {5: 0.012, 6: 0.01}),
                       right)
