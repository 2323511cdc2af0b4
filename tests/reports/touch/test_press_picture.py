"""A press drawn without a display: a picture, an animation, and what is said where neither can be."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import eitsim
from matcal.card import MaterialCard
from matcal.laws.hyperfoam import Hyperfoam
from reports.touch.press_picture import can_draw, check_picture, colours, draw_press, read_steps, strain_limits

CARD = MaterialCard("Table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm"))
SCENE = eitsim.Scene(punches=(eitsim.Punch(x_m=-0.02, force_N=0.5),), accuracy=eitsim.Accuracy(0.05))

drawn_here = pytest.mark.skipif(not can_draw(), reason="no library that draws without a display, such as libEGL")


@pytest.fixture(scope="module")
def series(tmp_path_factory):
    pytest.importorskip("pyvista")
    path = Path(tmp_path_factory.mktemp("press")) / "press.pvd"
    eitsim.write_press(SCENE, eitsim.press_of(SCENE, CARD, steps=2), path)
    return path


def pixels(picture):
    return np.asarray(picture.convert("RGB"), dtype=float)


def strained(pixels):
    """Share of pixels that are more blue than red, as where more than half of the largest strain is."""
    return np.mean(pixels[..., 2] > pixels[..., 0])


def test_steps_are_read_in_order_with_force_and_depth(series):
    steps = read_steps(series)
    assert [step.force_N for step in steps] == pytest.approx([0, 0.25, 0.5], rel=1e-3)
    assert np.all(np.diff([step.depth_m for step in steps]) > 0)
    assert steps[-1].rim_m == pytest.approx(0.1)
    assert steps[-1].axis_m == pytest.approx([-0.02, 0, 0], abs=1e-7)
    low, high = strain_limits(steps)
    assert low <= 0 < high == pytest.approx(100 * np.max(
        steps[-1].foam["driving_strain_principal"][steps[-1].foam.points[:, 2] == 0]))


@drawn_here
def test_the_picture_shows_foam_strain_and_electrodes(series, tmp_path):
    drawn = pixels(Image.open(draw_press(series, tmp_path / "press.png")))
    height = len(drawn)
    whole, near = drawn[:int(0.36 * height)], drawn[int(0.38 * height):int(0.8 * height)]
    orange = (whole[..., 0] > 120) & (whole[..., 1] < 100) & (whole[..., 2] < 80)
    yellow = (near[..., 0] > 150) & (near[..., 2] < 120)
    assert 200 < orange.sum() < 0.05 * orange.size
    assert yellow.mean() > 0.3
    assert 0.002 < strained(near) < 0.2


@drawn_here
def test_the_animation_has_a_picture_for_every_step_and_begins_unstrained(series, tmp_path):
    with Image.open(draw_press(series, tmp_path / "press.gif")) as moving:
        assert moving.n_frames == 3
        frames = []
        for k in range(3):
            moving.seek(k)
            frames.append(pixels(moving))
    near = [frame[int(0.38 * len(frame)):int(0.8 * len(frame))] for frame in frames]
    assert strained(near[0]) == 0 < strained(near[2])
    assert np.all(np.diff([np.mean(one[..., 0]) for one in near]) < -0.5)  # darker step by step


def test_colours_are_light_where_nothing_is_strained():
    assert colours((-60.0, 2.0)) == "cividis"
    assert colours((-2.0, 30.0)) == "cividis_r"


@drawn_here
@pytest.mark.parametrize("content", [None, "<VTKFile type='Collection'><Collection/></VTKFile>"])
def test_what_is_no_series_is_named(tmp_path, content):
    pytest.importorskip("pyvista")
    place = tmp_path / "press.pvd"
    if content is not None:
        place.write_text(content)
    with pytest.raises(ValueError, match="no series of a press"):
        draw_press(place, tmp_path / "press.png")


@drawn_here
@pytest.mark.parametrize(("old", "new", "named"), [
    (b"</VTKFile>", b"", "the VTU file is damaged"),
    (b"displacement_m", b"displaced_m", "the point field displacement_m is missing"),
    (b"driving_strain_", b"strain_", r"the point field a driving strain \(driving_strain_principal, .* is missing")])
def test_a_damaged_file_and_a_missing_field_are_named(series, tmp_path, capfd, caplog, old, new, named):
    shutil.copytree(series.parent, tmp_path, dirs_exist_ok=True)
    foam = tmp_path / "press" / "foam_001.vtu"
    foam.write_bytes(foam.read_bytes().replace(old, new))
    with pytest.raises(ValueError, match=rf"press/foam_001.vtu: {named}.* Write the series again: eitsim run"):
        draw_press(tmp_path / "press.pvd", tmp_path / "press.png")
    assert not capfd.readouterr().err + caplog.text


def test_a_missing_library_names_the_line_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(ValueError, match=r"need pyvista, which is not installed; run pip install '\.\[draw\]'"):
        check_picture(Path("press.png"))


@pytest.mark.parametrize(("display", "may"), [(None, False), (":0", True)])
def test_without_a_display_and_what_draws_without_one_the_package_to_install_is_named(monkeypatch, display, may):
    pytest.importorskip("pyvista")
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr("reports.touch.press_picture._OFF_SCREEN", ("libNone.so.1",))
    monkeypatch.delenv("DISPLAY", raising=False)
    if display:
        monkeypatch.setenv("DISPLAY", display)
    assert can_draw() is may
    if not may:
        with pytest.raises(ValueError, match=r"libNone\.so\.1, and none can be loaded.* apt-get install libegl1"):
            check_picture(Path("press.png"))
