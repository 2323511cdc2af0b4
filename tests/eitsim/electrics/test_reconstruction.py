"""Difference images: the Jacobian by pixels, recovery of known inclusions, the noise figure, files and refusals."""

import json
import re
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from subprocess import CompletedProcess

import meshio
import numpy as np
import pytest

from eitsim.electrics.cem.assembly import impedance, quadrature_points
from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.electrics.imaging.gauss_newton import (
    PRIORS,
    Imager,
    Untouched,
    check_prior,
    fitted,
    imager,
    on_grid,
    pixels,
)
from eitsim.electrics.imaging.greit_figures import Blob, blob, regions
from eitsim.electrics.imaging.images import images_of
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.scene.drive import Drive, read_out
from eitsim.scene.scene import Body, Electrodes, Scene
from touchcal.csv_numbers import write_numbers

S, SIZE = 6e-4, 0.009
PLACES = [(0.0, 0.0), (0.03, 0.02), (-0.02, 0.05), (0.06, -0.03)]


@lru_cache(maxsize=1)
def baseline() -> np.ndarray:
    """The untouched skin without a mesh."""
    return read_out(Drive(), solve_rim(Body(), Electrodes(), S).impedance_Ohm).ravel()


@lru_cache(maxsize=1)
def untouched() -> Untouched:
    return fitted(Body(), Electrodes(), Drive(), baseline())


@lru_cache(maxsize=2)
def made(prior: str) -> Imager:
    return imager(untouched(), prior=prior)


@lru_cache(maxsize=8)
def signal(place: tuple[float, float], contrast: float = 1.5) -> np.ndarray:
    """dV of a disc of higher conductance, solved in full on another mesh."""
    angles, electrode = rim_angles(Body(), Electrodes(), 3)
    mesh = ring_mesh(np.linspace(0, 0.1, 61), np.zeros((61, 2)), angles, electrode, 16)
    inside = np.hypot(*np.moveaxis(quadrature_points(mesh) - np.array(place), -1, 0)) < SIZE
    change = impedance(mesh, S * (1 + contrast * inside), 1.0) - impedance(mesh, np.full(len(mesh.cells), S), 1.0)
    return read_out(Drive(), change).ravel()


def distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def test_pixels_are_a_disc_of_nearly_equal_triangles():
    mosaic = pixels(0.1, 12)
    assert len(mosaic.triangles) == 6 * 12**2
    assert mosaic.area_m2.sum() == pytest.approx(np.pi * 0.01, rel=0.002)
    assert mosaic.area_m2.max() < 1.5 * mosaic.area_m2.min()


def test_untouched_conductance_is_found_from_a_frame():
    assert untouched().conductance_S == pytest.approx(S, rel=1e-3)
    assert distance(untouched().readings_V, baseline()) < 1e-3


def test_jacobian_adds_up_to_that_of_the_whole_and_meets_small_discs():
    step = [read_out(Drive(), solve_rim(Body(), Electrodes(), S * (1 + sign * 1e-3)).impedance_Ohm).ravel()
            for sign in (-1, 1)]
    assert distance(untouched().jacobian_V.sum(axis=1), (step[1] - step[0]) / 2e-3) < 1e-3
    mosaic = untouched().pixels
    near = np.hypot(*(mosaic.centre_m - np.array(PLACES[1])).T) < 0.02
    small = signal(PLACES[1], 0.01) * (mosaic.area_m2[near].sum() / (np.pi * SIZE**2))
    assert distance(untouched().jacobian_V[:, near].sum(axis=1) * 0.01, small) < 0.1


def off(found: Blob, place: tuple[float, float]) -> float:
    return float(np.hypot(found.x_m - place[0], found.y_m - place[1]))


@pytest.mark.parametrize("prior", PRIORS)
@pytest.mark.parametrize("place", PLACES)
def test_a_disc_is_found_within_its_size(prior: str, place: tuple[float, float]):
    points, area, image = on_grid(untouched().pixels, made(prior)(signal(place)))
    found = blob(points, area, image)
    assert found.peak > 0
    assert off(found, place) < SIZE


@pytest.mark.parametrize("prior", PRIORS)
@pytest.mark.parametrize("place", PLACES[2:])
def test_a_disc_is_found_within_its_diameter_at_60_dB(prior: str, place: tuple[float, float]):
    rng, noise_V = np.random.default_rng(3), 1e-3 * np.sqrt(np.mean(baseline()**2))
    frames = signal(place) + noise_V * rng.standard_normal((50, len(baseline())))
    points, area, images = on_grid(untouched().pixels, made(prior)(frames))
    away = [off(blob(points, area, image), place) for image in images]
    print(prior, place, np.quantile(away, [0.5, 0.9]))
    assert np.quantile(away, 0.9) < 2 * SIZE


@pytest.mark.parametrize("prior", PRIORS)
def test_noise_figure_is_the_one_asked_for(prior: str):
    rng, found = np.random.default_rng(4), made(prior)
    mosaic = untouched().pixels
    target = untouched().jacobian_V @ (np.hypot(*mosaic.centre_m.T) < 0.01)
    noise = rng.standard_normal((4000, len(target)))
    image = found(target) * mosaic.area_m2
    into = np.mean(np.abs(target)) / 1.0
    out = np.mean(np.abs(image)) / np.sqrt(np.mean((found(noise) * mosaic.area_m2) ** 2))
    assert into / out == pytest.approx(0.5, rel=0.03)
    smoother = imager(untouched(), prior=prior, noise_figure=0.3)
    assert smoother.weight > found.weight


def test_what_cannot_be_imaged_is_refused():
    with pytest.raises(ValueError, match="known: noser, laplace"):
        imager(untouched(), prior="tikhonov")
    with pytest.raises(ValueError, match="noise figure 1e\\+09 cannot be had"):
        imager(untouched(), noise_figure=1e9)
    with pytest.raises(ValueError, match="no uniform conductance"):
        fitted(Body(), Electrodes(), Drive(), -baseline())
    with pytest.raises(ValueError, match="has 100 readings"):
        fitted(Body(), Electrodes(), Drive(), baseline()[:100])


def test_frames_in_another_order_are_refused_and_no_image_is_written(
        command: Callable[..., CompletedProcess[str]], tmp_path: Path):
    order = np.random.default_rng(3).permutation(baseline().size)
    write_numbers(tmp_path / "frames.csv", [], np.array([baseline(), baseline() + signal(PLACES[1])])[:, order])
    done = command("eitsim", "reconstruct", "frames.csv", "--out", "image.csv", cwd=tmp_path)
    assert done.returncode == 2
    assert re.search(r"4\d\.\d\d% of it stay unexplained.*`eitsim sensor inspect`", done.stderr)
    assert not (tmp_path / "image.csv").exists()


def test_patches_are_fitted_and_imaged():
    electrodes = Electrodes(kind="patch", length_m=0.008)
    frame = read_out(Drive(), untouched_impedance(Body(), electrodes, S)).ravel()
    found = fitted(Body(), electrodes, Drive(), frame)
    assert found.conductance_S == pytest.approx(S, rel=2e-3)
    again = read_out(Drive(), untouched_impedance(Body(), electrodes, 1.001 * S)).ravel()
    assert distance(found.jacobian_V.sum(axis=1) * 1e-3, again - frame) < 0.01


def test_a_missing_electrode_leaves_its_readings_out():
    frame, electrodes = baseline().copy(), Electrodes(missing=(5,))
    found = fitted(Body(), electrodes, Drive(), frame)
    lost = np.isnan(found.readings_V)
    assert 0 < lost.sum() < len(lost)
    dv = np.where(lost, 1.0, signal(PLACES[2]))
    points, area, image = on_grid(found.pixels, imager(found)(dv))
    assert off(blob(points, area, image), PLACES[2]) < 2 * SIZE


def test_command_writes_images_of_frames(command: Callable[..., CompletedProcess[str]], tmp_path: Path):
    names = [f"v_{i:03d}" for i in range(208)]
    write_numbers(tmp_path / "frames.csv", names, np.array([baseline(), baseline() + signal(PLACES[3])]))
    done = command("eitsim", "reconstruct", "frames.csv", "--out", "image.vtu", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (told,) = json.loads(done.stdout)["frames"]
    assert np.hypot(told["x_mm"] - 60, told["y_mm"] + 30) < 9
    mesh = meshio.read(tmp_path / "image.vtu")
    assert mesh.cell_data["frame_000"][0].max() == pytest.approx(told["peak"], rel=1e-6)
    write_numbers(tmp_path / "rest.csv", names, baseline()[None])
    done = command("eitsim", "reconstruct", "frames.csv", "--baseline", "rest.csv", "--out", "image.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "line 2: this frame equals the untouched one" in done.stdout
    lines = (tmp_path / "image.csv").read_text().splitlines()
    assert lines[0] == "x_mm,y_mm,area_mm2,frame_000,frame_001"
    assert float(lines[1].split(",")[3]) == 0
    done = command("eitsim", "reconstruct", "frames.csv", "--out", "image.png", cwd=tmp_path)
    assert (done.returncode, "give a name that ends so" in done.stderr) == (2, True)


@pytest.mark.parametrize(("prior", "noise_figure", "named"), [
    ("tv", 0.5, "prior 'tv' is unknown; known: noser, laplace"), ("laplace", -1.0, "must be positive and finite"),
    ("noser", float("nan"), "must be positive and finite")])
def test_what_is_not_built_is_refused_before_any_work(prior: str, noise_figure: float, named: str):
    with pytest.raises(ValueError, match=named):
        check_prior(prior, noise_figure)


def test_frames_that_no_touch_makes_have_no_place_and_a_note(tmp_path: Path):
    """A sign, a unit or a gain that is another one, and noise without a touch."""
    noise = 1e-5 * np.random.default_rng(1).standard_normal(baseline().size)
    odd = [-baseline(), 1e6 * baseline(), 1.01 * baseline(), baseline() + noise]
    write_numbers(tmp_path / "frames.csv", [f"v_{i:03d}" for i in range(baseline().size)],
                  np.array([baseline(), *odd]))
    told = images_of(tmp_path / "frames.csv", Scene())[1]["frames"]
    for image, named in zip(told, ("sign is flipped", "no touch does", "fills 100%", "as noise does"), strict=True):
        assert named in image["note"]
        assert image["x_mm"] is image["y_mm"] is None


def test_two_discs_far_apart_are_two_regions_and_said_to_be(tmp_path: Path):
    """The signals of two small targets, by the derivatives, 55 mm to either side of the middle."""
    pixel = untouched().pixels
    change = sum(0.3 * (np.hypot(*(pixel.centre_m - [x, 0.0]).T) < 0.012) for x in (-0.055, 0.055))
    write_numbers(tmp_path / "frames.csv", [f"v_{i:03d}" for i in range(baseline().size)],
                  np.array([baseline(), baseline() + untouched().jacobian_V @ change]))
    (image,) = images_of(tmp_path / "frames.csv", Scene(), noise_figure=1.0)[1]["frames"]
    assert "2 separate regions" in image["note"]
    assert sorted(round(part["x_mm"] / 55) for part in image["regions"]) == [-1, 1]


def test_regions_are_what_hangs_together_at_half_the_largest_value():
    x, y = np.meshgrid(np.arange(30.0), np.arange(20.0))
    points = np.column_stack([x.ravel(), y.ravel()])
    image = -np.exp(-((points[:, 0] - 6)**2 + (points[:, 1] - 10)**2) / 8)
    image -= 0.8 * np.exp(-((points[:, 0] - 22)**2 + (points[:, 1] - 10)**2) / 8)
    first, second = regions(points, np.ones(len(points)), image)
    assert (first.x_m, first.y_m, second.x_m, second.y_m) == pytest.approx((6, 10, 22, 10))
    assert (first.peak, second.peak) == pytest.approx((-1, -0.8))
