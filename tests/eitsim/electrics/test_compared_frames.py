"""Images of readings that no uniform skin explains: gains, magnitudes, differences, what was not measured, orders."""

import json
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import impedance, quadrature_points
from eitsim.electrics.imaging.compared import Unexplained, compared
from eitsim.electrics.imaging.gauss_newton import imager, uniform
from eitsim.electrics.imaging.images import Images, images_of, reconstruct
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.scene.drive import Drive, read_out
from eitsim.scene.scene import Body, Electrodes, Scene
from eitsim.sensors.formats.open_file import open_frames
from eitsim.sensors.sensor_file import scene_of_frames
from touchcal.csv_numbers import write_numbers

S, SIZE = 6e-4, 0.012
PLACE = (0.045, 0.03)
CASES = Path(__file__).resolve().parents[4] / "shared" / "cases" / "eit"


@lru_cache(maxsize=8)
def frames(count: int, reading: str = "differential", contrast: float = -0.8) -> tuple[np.ndarray, np.ndarray, Scene]:
    """Untouched readings, those with a disc of another conductance, and the scene of their sensor."""
    electrodes, drive = Electrodes(count=count, width_m=0.06 / count), Drive(reading=reading)
    angles, electrode = rim_angles(Body(), electrodes, 2)
    mesh = ring_mesh(np.linspace(0, 0.1, 41), np.zeros((41, 2)), angles, electrode, count)
    inside = np.hypot(*np.moveaxis(quadrature_points(mesh) - np.array(PLACE), -1, 0)) < SIZE
    both = (impedance(mesh, S * (1 + contrast * k * inside), 1.0) for k in (0.0, 1.0))
    rest, touched = (read_out(drive, z).ravel() for z in both)
    return rest, touched, Scene(electrodes=electrodes, drive=drive)


def off_m(found: Images, k: int = 0) -> float:
    """Distance of image k from the disc."""
    place = found.seen[k].blob
    assert place is not None
    return float(np.hypot(place.x_m - PLACE[0], place.y_m - PLACE[1]))


@pytest.mark.parametrize(("count", "seed"), [(8, 0), *(pytest.param(16, k, marks=pytest.mark.slow) for k in range(3))])
def test_gains_of_single_readings_cancel_in_normalised_differences(count: int, seed: int) -> None:
    rest, touched, scene = frames(count)
    rng = np.random.default_rng(seed)
    gain = np.exp(rng.normal(0, 1.5, rest.size)) * rng.choice([-1, 1], rest.size)
    found = reconstruct(gain * touched, gain * rest, scene=scene)
    assert found.differences == "normalised"
    assert found.seen[0].clear
    assert off_m(found) < 2 * SIZE
    assert found.misfit is None
    assert any("stay unexplained" in one or "no uniform conductance" in one for one in found.cautions)
    assert not any("empty" in one for one in found.cautions)
    assert any("qualitative" in one for one in found.cautions)
    with pytest.raises(Unexplained):
        reconstruct(gain * touched, gain * rest, scene=scene, differences="volts")


def test_readings_in_another_order_are_no_gains() -> None:
    rest, touched, scene = frames(16)
    order = np.random.default_rng(0).permutation(rest.size)
    with pytest.raises(ValueError, match=r"normalised differences leave \d+% of the frames' changes.*sensor inspect"):
        reconstruct(touched[order], rest[order], scene=scene)


@pytest.mark.thorough
@pytest.mark.parametrize(("count", "reading"), [(8, "single-ended"), (16, "differential")])
def test_magnitudes_take_the_signs_of_the_uniform_skin(count: int, reading: str) -> None:
    rest, touched, scene = frames(count, reading)
    signed = reconstruct(touched, rest, scene=scene)
    found = reconstruct(np.abs(touched), np.abs(rest), scene=scene, kind="magnitude")
    assert (found.differences, found.cautions) == ("volts", ())
    np.testing.assert_allclose(found.change, signed.change, rtol=0, atol=1e-6 * np.abs(signed.change).max())


def test_differences_are_imaged_without_an_untouched_frame(tmp_path: Path) -> None:
    rest, touched, scene = frames(16)
    write_numbers(tmp_path / "frames.csv", [], 37.0 * np.array([touched - rest, rest - touched]))
    found, document = images_of(tmp_path / "frames.csv", scene, kind="difference")
    assert off_m(found) < 2 * SIZE
    assert len(document["frames"]) == 2
    assert document["misfit"] is document["conductance_S"] is None
    with pytest.raises(ValueError, match="need an untouched frame"):
        reconstruct(touched, None, scene=scene)


@pytest.mark.thorough
@pytest.mark.parametrize(("empty", "kind"), [(0.0, "voltage"), (np.nan, "magnitude")])
def test_readings_at_driven_pairs_that_were_not_measured_are_left_out(empty: float, kind: str) -> None:
    """All 16 pairs of neighbours in each pattern, those with a driven electrode 0 or empty, image as without them."""
    rest, touched, scene = frames(16)
    unit = np.eye(16)
    onwards = np.roll(unit, 1, axis=1)
    whole = Drive(currents=(unit - onwards).tolist(), measurements=(onwards - unit).tolist())
    volts = np.full((2, 256), empty)
    for p in range(16):
        volts[:, 16 * p + (p + 2 + np.arange(13)) % 16] = np.array([rest, touched])[:, 13 * p:13 * p + 13]
    found = reconstruct(volts[1], volts[0], scene=Scene(electrodes=scene.electrodes, drive=whole), kind=kind)
    assert found.cautions == ("48 of 256 readings are empty in a frame, or 0 in all: they were left out.",)
    plain = reconstruct(touched, rest, scene=scene)
    np.testing.assert_allclose(found.change, plain.change, rtol=0, atol=1e-6 * np.abs(plain.change).max())


def test_too_few_measured_readings_are_refused() -> None:
    rest, touched, scene = frames(16)
    rest = np.where(np.arange(rest.size) < 10, rest, np.nan)
    with pytest.raises(ValueError, match="only 10 of 208 readings are measured"):
        compared(touched[None], rest, scene, "voltage", "auto")


def test_a_default_noise_figure_that_cannot_be_had_is_the_nearest_one_and_said() -> None:
    """Of 8 electrodes read between neighbours, noser reaches no 0.5."""
    rest, touched, scene = frames(8)
    found = reconstruct(touched, rest, scene=scene, prior="noser")
    assert 0.5 < found.noise_figure < 1
    assert found.cautions == (f"The usual noise figure of 0.5 cannot be had with these readings: "
                              f"{found.noise_figure:.2g} is taken, the nearest that can.",)
    with pytest.raises(ValueError, match=r"noise figure 0.5 cannot be had.*Give a noise_figure \(--noise-figure\)"):
        reconstruct(touched, rest, scene=scene, prior="noser", noise_figure=0.5)


@pytest.mark.slow
def test_a_noise_figure_between_those_at_both_ends_of_the_weight_is_found() -> None:
    """Of 32 electrodes with skip-2 the figure falls, then rises, as the weight falls."""
    untouched = uniform(Body(), Electrodes(count=32, width_m=0.006), Drive(pattern="skip-2", reading="differential"))
    assert imager(untouched, noise_figure=0.2).noise_figure == pytest.approx(0.2, rel=1e-4)


def test_a_change_below_the_whole_of_a_conductance_is_marked() -> None:
    rest, touched, scene = frames(16, contrast=-0.999)
    found = reconstruct(rest + 5 * (touched - rest), rest, scene=scene)
    assert found.change.min() < -1
    assert "no conductance falls by more than its whole" in found.seen[0].note
    assert "whole" not in reconstruct(touched, rest, scene=scene).seen[0].note


@pytest.mark.thorough
def test_the_command_images_magnitudes_and_says_what_to_mind(
        command: Callable[..., CompletedProcess[str]], tmp_path: Path) -> None:
    rest, touched, _ = frames(16)
    gain = np.exp(np.random.default_rng(5).normal(0, 1.5, rest.size))
    write_numbers(tmp_path / "frames.csv", [], np.abs(gain * np.array([rest, touched])))
    (tmp_path / "sensor.toml").write_text('[electrodes]\ncount = 16\nwidth_mm = 3.75\n[drive]\nreading = '
                                          '"differential"\n[readings]\nkind = "magnitude"\n')
    done = command("eitsim", "reconstruct", "frames.csv", "--scene", "sensor.toml", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (image,) = json.loads(done.stdout)["frames"]
    assert np.hypot(image["x_mm"] - 45, image["y_mm"] - 30) < 24
    done = command("eitsim", "reconstruct", "frames.csv", "--scene", "sensor.toml", "--differences", "volts",
                   cwd=tmp_path)
    assert (done.returncode, "stay unexplained" in done.stderr) == (2, True)


def _case(folder: str, file: str, sensor: str) -> Images:
    if not (CASES / folder).is_dir():
        pytest.skip("the recordings of other groups are not here")
    scene, kind = scene_of_frames(CASES / folder / sensor)
    return images_of(CASES / folder / file, scene, kind=kind, read=open_frames)[0]


@pytest.mark.slow
def test_a_moving_target_in_raw_counts_is_followed() -> None:
    """One turn at 0.60 to 0.66 of the radius, and a straight line, by another program's normalised differences."""
    folder = "03_montreal_moving_target"
    around = [one for one in _case(folder, "drop3.csv", "sensor3.toml").seen if one.clear and one.blob]
    assert len(around) >= 90
    away = np.array([np.hypot(one.blob.x_m, one.blob.y_m) / 0.15 for one in around if one.blob])
    assert 0.55 < away.min() <= away.max() < 0.72
    turn = np.unwrap([np.arctan2(one.blob.y_m, one.blob.x_m) for one in around if one.blob])
    even = np.polyval(np.polyfit(np.arange(len(turn)), turn, 1), np.arange(len(turn)))
    assert np.degrees(np.abs(turn - even)).max() < 15
    across = np.array([(one.blob.x_m, one.blob.y_m) for one in _case(folder, "drop4.csv", "sensor4.toml").seen
                       if one.clear and one.blob]) / 0.15
    ends = np.array([[0.58, 0.23], [-0.58, -0.27]])
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    sideways = (across - ends[0]) @ [-along[1], along[0]]
    assert np.abs(sideways).max() < 0.08
    assert np.ptp((across - ends[0]) @ along) > 1.0


@pytest.mark.slow
def test_a_boards_magnitudes_and_zeros_image_what_was_put_in() -> None:
    image = _case("01_kaufmann_skip7_mat", "vhvi.mat", "sensor.toml").seen[0].blob
    assert image is not None
    assert np.degrees(np.arctan2(image.y_m, image.x_m)) == pytest.approx(11.25, abs=5)
    middle, upper, two = _case("02_golfball_phantom_mat", "vhvi.mat", "sensor_true.toml").seen
    assert middle.blob is not None
    assert upper.blob is not None
    assert np.hypot(middle.blob.x_m, middle.blob.y_m) < 0.01
    assert abs(upper.blob.x_m) < 0.01
    assert len(two.regions) == 2
