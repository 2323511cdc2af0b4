"""Maps of the skin from a file of `eitsim run --skin`."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pandas as pd
import pytest

from reports.document.style import house
from reports.sweep.sweep_report import write
from reports.touch import skin_maps, touch_report
from touchcal.errors import InputFileError
from touchcal.provenance import file_identity

Make = Callable[..., Path]
Reader = Callable[[Path], Any]


def write_skin(path: Path, **without: object) -> Path:
    """Synthetic skin: triangles of a disc, each with corners of its own, and fields of known size."""
    rings, spokes = 12, 48
    radius, angle = np.meshgrid(np.linspace(0.002, 0.1, rings), 2 * np.pi * np.arange(spokes) / spokes, indexing="ij")
    x, y = (radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()
    number = np.arange(rings * spokes).reshape(rings, spokes)
    after = np.roll(number, -1, axis=1)
    quads = [a.ravel() for a in (number[:-1], number[1:], after[1:], after[:-1])]
    cells = np.vstack([np.column_stack([quads[i] for i in three]) for three in ((0, 1, 2), (0, 2, 3))]).ravel()
    x, y = x[cells], y[cells]
    fields = {"displacement_m": np.column_stack([0 * x, 0 * x, -0.003 * np.exp(-(x**2 + y**2) / 1e-3)]),
              "contact_pressure_Pa": 7000.0 * (np.hypot(x, y) < 0.03), "largest_in_plane_strain": 3.0 * x**2,
              "potential_V_00": 2 * x, "untouched_potential_V_00": x, "potential_V_01": y,
              "untouched_potential_V_01": y}
    kept = {name: values for name, values in fields.items() if name not in without}
    points = np.column_stack([x, y, 0 * x])
    meshio.Mesh(points, [("triangle", np.arange(len(x)).reshape(-1, 3))], point_data=kept).write(path)
    return path


def test_points_at_one_place_become_one_and_fields_stay(tmp_path: Path) -> None:
    skin = skin_maps.read(write_skin(tmp_path / "skin.vtu"))
    assert len(skin.triangles.x) == 12 * 48
    assert skin.patterns == (0, 1)
    assert np.allclose(skin.fields["potential_V_00"], 2e-3 * skin.triangles.x)


def test_levels_part_the_disc_in_equal_areas(tmp_path: Path) -> None:
    skin = skin_maps.read(write_skin(tmp_path / "skin.vtu"))
    part = skin_maps._levels(skin.triangles, skin.triangles.x) / 100
    below = 0.5 + (part * np.sqrt(1 - part**2) + np.arcsin(part)) / np.pi
    assert np.allclose(below, np.linspace(0, 1, 23)[1:-1], atol=0.01)


@pytest.mark.thorough
def test_a_report_shows_the_maps_of_its_result_and_their_numbers(tmp_path: Path, write_result: Make,
                                                                 read_pdf: Reader) -> None:
    skin = write_skin(tmp_path / "skin.vtu")
    source = write_result(skin_file=file_identity(skin, tmp_path))
    write(source, tmp_path / "t.pdf")
    text = read_pdf(tmp_path / "t.pdf").whole
    for words in ("contact pressure up to 7.00 kPa", "Largest in-plane strain (–)", "pattern 1, change", "skin.vtu"):
        assert words in text
    table = pd.read_csv(tmp_path / "t_files" / "response.csv")
    assert table["depth_mm"].max() == pytest.approx(3 * np.exp(-4e-3))
    assert np.allclose(pd.read_csv(tmp_path / "t_files" / "equipotentials.csv")["touched_V_0"], 2e-3 * table["x_mm"])


def test_maps_of_another_run_are_not_shown(tmp_path: Path, write_result: Make) -> None:
    def said(source: Path) -> str:
        with house():
            return " ".join(touch_report.report(source).absent.values())

    skin = write_skin(tmp_path / "skin.vtu")
    source = write_result(skin_file=file_identity(skin, tmp_path) | {"sha256": "0" * 64})
    assert "is not the file that was written with this result" in said(source)
    skin.unlink()
    assert "is not next to it" in said(source)
    assert "skin_file" not in json.loads(write_result().read_text())
    assert "the result names no file of them" in said(write_result())


def test_a_file_without_the_fields_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="contact_pressure_Pa"):
        skin_maps.read(write_skin(tmp_path / "skin.vtu", contact_pressure_Pa=None))
    (tmp_path / "text.vtu").write_text("no mesh")
    with pytest.raises(InputFileError, match=r"text\.vtu"):
        skin_maps.read(tmp_path / "text.vtu")
