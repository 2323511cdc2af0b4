"""Sheets in space: isometries change nothing, round parts have their area, patches do what they do on flat meshes."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess
from types import ModuleType

import meshio
import numpy as np
import pytest
from skfem import ElementTriP2
from skfem.quadrature import get_quadrature

from eitsim.electrics.cem.assembly import impedance
from eitsim.electrics.curved import adapted_sheet
from eitsim.electrics.curved.adapted_sheet import skin_mesh
from eitsim.electrics.curved.facets import Facets, halved, slopes
from eitsim.electrics.curved.rounds import Ball, cut_out, refined_at
from eitsim.electrics.curved.solve_curved import facets_of, prepared, solve_curved_skin
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.outline.adapted_mesh import readings_difference, solve_untouched
from eitsim.scene.curved_skin import CurvedSkin, read_curved_skin
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import read_scene
from eitsim.scene.triangles.triangle_files import TriangleMesh, read_triangles
from touchcal.arrays import Array
from touchcal.errors import InputFileError, NotConverged

S = 6e-4  # S


@pytest.fixture(scope="module")
def skins(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    """benchmarks/curved_skins.py, which makes the sheets."""
    return benchmark_module("curved_skins")


@pytest.mark.slow
def test_a_cylinder_with_16_electrodes_is_its_unrolled_rectangle_to_1e_6(skins: ModuleType) -> None:
    """Currents that are even about two opposite lines see half of the cylinder: a rectangle with 8 electrodes."""
    found = solve_curved_skin(skins.cylinder(16, 8), readings=1e-6)
    assert readings_difference(skins.even_part(found.impedance_Ohm), skins.unrolled(16)) < 1e-6
    assert found.readings_error < 1e-6


def test_folding_a_sheet_along_lines_of_its_mesh_changes_nothing(skins: ModuleType) -> None:
    columns, rows = np.linspace(0, 0.1, 11), np.linspace(0, 0.06, 7)
    turn = np.cumsum(np.random.default_rng(1).uniform(-1, 1, 10))
    steps = np.diff(columns)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    bend = np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)])

    def folded(s: Array, z: Array) -> Array:
        return np.column_stack([np.interp(s, columns, bend[:, 0]), np.interp(s, columns, bend[:, 1]), z])

    nodes, cells, middle = skins.sheet(columns, rows, folded)
    plane, same, _ = skins.sheet(columns, rows, lambda s, z: np.column_stack([s, z, 0 * s]))
    assert np.array_equal(cells, same)
    corner = (np.abs(middle[:, 0] - 0.05) > 0.03) & (np.abs(middle[:, 1] - 0.03) > 0.01)
    electrode = np.where(corner, 2 * (middle[:, 0] > 0.05) + (middle[:, 1] > 0.03), -1)
    found = []
    for points in (nodes, plane):
        facets = replace(facets_of(TriangleMesh("", points, cells, {})), electrode=electrode)  # type: ignore[arg-type]
        found.append(impedance(skin_mesh(facets, 4), np.full(len(cells), S), 1e-2))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-10)


@pytest.mark.thorough
def test_a_flat_sheet_in_space_is_the_flat_sheet_and_its_error_is_estimated(skins: ModuleType) -> None:
    nodes, cells, middle = skins.sheet(np.linspace(-0.06, 0.06, 25), np.linspace(-0.04, 0.04, 17),
                                 lambda s, z: skins.turned(np.column_stack([s, z])))
    groups = {k: np.flatnonzero(np.abs(middle - place).max(axis=1) < 0.005)
                                      for k, place in enumerate(skins.PLACES)}
    skin = CurvedSkin(TriangleMesh("flat", nodes, cells, groups), S, groups=tuple(range(8)))  # type: ignore[arg-type]
    electrodes = Electrodes(kind="surface", count=8, shape="rectangle", width_m=0.01, length_m=0.01,
                            x_m=tuple(skins.PLACES[:, 0].tolist()), y_m=tuple(skins.PLACES[:, 1].tolist()))
    known = solve_untouched(Outline("rectangle", width_m=0.12, height_m=0.08), electrodes, S, 1e-6)
    coarse, fine = (solve_curved_skin(skin, readings=asked) for asked in (1e-3, 2e-6))
    for found in (coarse, fine):
        assert readings_difference(found.impedance_Ohm, known.impedance_Ohm) < found.readings_error + known.error
    assert fine.readings_error < 2e-6 < coarse.readings_error


@pytest.mark.slow
def test_a_patch_changes_readings_as_on_a_flat_mesh_of_another_mesher(skins: ModuleType) -> None:
    found = solve_curved_skin(skins.touched_sheet(), signal=2e-4)
    assert found.signal_error is not None
    assert readings_difference(found.touched_Ohm - found.impedance_Ohm, skins.flat_change(2e-6)) < 2e-4
    assert found.signal_error < 2e-4
    assert np.linalg.norm(found.signal_V) > 1e-3 * np.linalg.norm(found.baseline_V)


def test_triangles_that_a_ball_cuts_are_small_and_those_far_from_it_stay(skins: ModuleType) -> None:
    line = np.linspace(-1.0, 1.0, 11)
    nodes, cells, _ = skins.sheet(line, line, lambda s, z: 0.05 * np.column_stack([s, z, 0 * s]))
    whole = facets_of(TriangleMesh("square", nodes, cells, {}))  # type: ignore[arg-type]
    found = refined_at(whole, [Ball(np.array([0.004, -0.003, 0.0]), 0.008)])
    corners = found.corners_m
    away = np.linalg.norm(corners - [0.004, -0.003, 0.0], axis=2)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    at = (away.min(axis=1) < 0.008) & (away.max(axis=1) > 0.008)
    assert at.any()
    assert longest[at].max() <= 2 * np.pi * 0.008 / Ball(np.zeros(3), 0.008).chords
    assert longest[away.min(axis=1) > 0.035].min() == pytest.approx(0.01 * np.sqrt(2))


def test_a_ball_cuts_the_area_of_a_cap_out_of_a_sphere_and_one_piece_alone(skins: ModuleType) -> None:
    """The cap within a chord r of a point of a sphere has the area pi r^2, whatever the sphere's radius."""
    line = np.linspace(-1.2, 1.2, 25)
    nodes, cells, _ = skins.sheet(line, line, lambda s, z: 0.05 * np.column_stack(
        [np.sin(s), np.cos(s) * np.sin(z), np.cos(s) * np.cos(z)]), quadratic=True)
    facets = facets_of(TriangleMesh("cap", nodes, cells, {}))  # type: ignore[arg-type]
    centre = 0.05 * np.array([np.sin(0.31), np.cos(0.31) * np.sin(-0.2), np.cos(0.31) * np.cos(-0.2)])
    cut, inside = cut_out(facets, centre, 0.008)
    assert areas_m2(cut)[inside].sum() == pytest.approx(np.pi * 0.008**2, rel=2e-4)
    conforming(cut)
    two = np.vstack([nodes, nodes + np.array([0, 0, 0.004])])
    sheets = facets_of(TriangleMesh("two", two, np.vstack([cells, cells + len(nodes)]), {}))  # type: ignore[arg-type]
    cut, inside = cut_out(sheets, centre, 0.008)
    assert cut.parent[inside].max() < len(cells)


def areas_m2(facets: Facets) -> Array:
    points, weights = get_quadrature(ElementTriP2(), 6)
    tangents = np.einsum("tkx,pkb->tpbx", facets.nodes_m[facets.cells], slopes(points.T))
    return np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1) @ weights


def conforming(facets: Facets) -> None:
    """Neighbours share whole edges, and the middles of these."""
    edges, own = facets.edges
    middles = facets.cells[:, 3:]
    for k in range(3):
        assert len(np.unique(np.column_stack([own[:, k], middles[:, k]]), axis=0)) == len(np.unique(own[:, k]))
    times = np.bincount(own.ravel())
    assert times.max() == 2
    assert len(edges) == len(np.unique(middles))


def test_halving_keeps_the_sheet_and_its_angles(skins: ModuleType) -> None:
    nodes, cells, _ = skins.sheet(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5), lambda s, z: 0.05 * np.column_stack(
        [s, z, s * z]), quadratic=True)
    facets = facets_of(TriangleMesh("saddle", nodes, cells, {}))  # type: ignore[arg-type]
    for _ in range(12):
        away = np.linalg.norm(facets.corners_m.mean(axis=1) - [0.01, 0.02, 0.004], axis=1)
        facets = halved(facets, away < np.quantile(away, 0.1))
    conforming(facets)
    x, y, z = facets.nodes_m.T / 0.05
    np.testing.assert_allclose(z, x * y, atol=1e-12)
    corners = facets.corners_m
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert (areas_m2(facets) / sides.max(axis=1) ** 2).min() > 0.1
    boundary = np.bincount(facets.edges[1].ravel()) == 1
    on = facets.nodes_m[facets.edges[0][boundary]] / 0.05
    assert np.all(np.abs(np.abs(on[..., :2]).max(axis=2) - 1) < 1e-12)


def test_the_mesh_halved_in_space_keeps_its_curves(skins: ModuleType) -> None:
    mesh = skin_mesh(prepared(skins.cylinder(4, 8)), 4)
    finer = uniform_refinement(mesh)
    away = np.hypot(finer.nodes_m[:, 0], finer.nodes_m[:, 1]) / 0.05 - 1
    assert np.abs(away).max() < 1e-5  # chords would be 5e-3 off


@pytest.mark.slow
def test_accuracy_that_needs_too_many_triangles_is_not_reached(skins: ModuleType,
                                                               monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapted_sheet, "_MOST", 1000)
    with pytest.raises(NotConverged, match="are known to"):
        solve_curved_skin(skins.touched_sheet(), readings=1e-13)
    with pytest.raises(NotConverged, match=r"^the signal of the curved skin is known to .* 1e-13 was asked"):
        solve_curved_skin(skins.touched_sheet(), readings=1.0, signal=1e-13)


def test_a_change_of_rounding_alone_is_exact(skins: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapted_sheet, "_MOST", 10_000)
    skin = skins.touched_sheet()
    for factor in (1.0, 1 + 1e-15):
        patch = replace(skin.patches[0], factor=factor)
        found = solve_curved_skin(replace(skin, patches=(patch,)), readings=1e-2)
        assert found.signal_error == 0
        assert np.abs(found.signal_V).max() < 1e-12 * np.abs(found.baseline_V).max()
    weak = replace(skin.patches[0], factor=1 + 1e-9)
    assert solve_curved_skin(replace(skin, patches=(weak,)), readings=1e-2).signal_error != 0


SKIN = """[body]
mesh = "sheet.stl"
[skin]
conductance_S = 6e-4
[electrodes]
x_mm = [-45, -15, 15, 45]
y_mm = [0, 0, 0, 0]
z_mm = [0, 0, 0, 0]
width_mm = 10
"""
PATCH = "[[patch]]\nx_mm = 5\ny_mm = 20\nz_mm = 0\nwidth_mm = 16\nfactor = 0.5\n"


@pytest.fixture
def skin_file(skins: ModuleType, tmp_path: Path) -> Path:
    nodes, cells, _ = skins.sheet(np.linspace(-0.06, 0.06, 13), np.linspace(-0.04, 0.04, 9),
                            lambda s, z: np.column_stack([s, z, 0 * s]))
    meshio.write(tmp_path / "sheet.stl", meshio.Mesh(nodes * 1e3, [("triangle", cells)]))
    (tmp_path / "skin.toml").write_text(SKIN + PATCH, encoding="utf-8")
    return tmp_path / "skin.toml"


@pytest.mark.slow
def test_the_command_gives_readings_without_and_with_the_patch(command: Callable[..., CompletedProcess[str]],
                                                               skin_file: Path) -> None:
    done = command("eitsim", "solve-mesh", str(skin_file), "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    found = solve_curved_skin(skin_file)
    np.testing.assert_allclose(document["readings_V"], found.touched_V)
    np.testing.assert_allclose(np.array(document["baseline_V"]) + document["signal_V"], document["readings_V"])
    assert document["error_estimate"]["signal"] == pytest.approx(found.signal_error)
    refused = command("eitsim", "solve-mesh", str(skin_file), "--element", "P2")
    assert refused.returncode == 2
    assert "takes no --variable, --scene and --element" in refused.stderr


@pytest.mark.parametrize(("old", "new", "message"), [
    (PATCH, "[punch]\nforce_N = 1\n", r"\[punch\]: a sheet has no layer"),
    (PATCH, "[hold]\ntime_s = [1]\n", r"\[hold\]: a sheet has no layer"),
    ("z_mm = 0\nwidth_mm = 16", "z_mm = 9\nwidth_mm = 16", r"patch 0 \(from 0\) lies off the sheet, whose nearest"),
    ("45]", "19]", r"electrodes 2 and 3 \(from 0\) overlap"),
    ("z_mm = [0, 0, 0, 0]", "z_mm = [0, 0, 0]", "one number an electrode each, got 4, 4, 3"),
    ("width_mm = 10", "width_mm = [10, 10]", r"width_mm in \[electrodes\] must hold one number or 4, got 2"),
    ("factor = 0.5", "factor = 0", r"factor in \[\[patch\]\] must be a positive number"),
    ("factor = 0.5", "factor = 1", r"factor in \[\[patch\]\] is 1, which changes nothing"),
    ("x_mm = [-45, -15, 15, 45]\ny_mm = [0, 0, 0, 0]\nz_mm = [0, 0, 0, 0]\nwidth_mm = 10", "groups = [true, 2, 3, 4]",
     r"groups in \[electrodes\] must hold whole numbers or names, got True"),
    ("sheet.stl", "none.stl", "no such file. Check the name"),
    ("width_mm = 10", "widht_mm = 10", "Did you mean 'width_mm'"),
])
def test_what_cannot_be_is_refused(skin_file: Path, old: str, new: str, message: str) -> None:
    text = skin_file.read_text(encoding="utf-8")
    assert old in text
    skin_file.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputFileError, match=message) as refused:
        solve_curved_skin(skin_file)
    file = skin_file.parent / "none.stl" if new == "none.stl" else skin_file
    assert str(refused.value).startswith(f"{file}: ")


def test_a_scene_with_a_curved_mesh_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text('[body]\nmesh = "hand.stl"\n[punch]\nforce_N = 1\n', encoding="utf-8")
    with pytest.raises(InputFileError, match="a sheet without a layer"):
        read_scene(tmp_path / "scene.toml")


def test_groups_are_read_by_number_and_name_and_a_missing_one_is_named(skins: ModuleType, tmp_path: Path) -> None:
    nodes, cells, middle = skins.sheet(np.linspace(0, 0.1, 11), np.linspace(0, 0.06, 7),
                                 lambda s, z: np.column_stack([s, z, 0.2 * s**2]))
    corner = (np.abs(middle[:, 0] - 0.05) > 0.03) & (np.abs(middle[:, 1] - 0.03) > 0.01)
    tag = np.where(corner, 1 + 2 * (middle[:, 0] > 0.05) + (middle[:, 1] > 0.03), 0)
    for suffix, units in ((".vtu", "group"), (".msh", "gmsh:physical")):
        data = {units: [tag]} | ({"gmsh:geometrical": [tag]} if suffix == ".msh" else {})
        meshio.write(tmp_path / f"sheet{suffix}", meshio.Mesh(nodes, [("triangle", cells)], cell_data=data),
                     **({"file_format": "gmsh22"} if suffix == ".msh" else {}))
        found = read_triangles(tmp_path / f"sheet{suffix}", 1.0)
        assert sorted(found.groups) == [0, 1, 2, 3, 4]
        assert found.nodes_m.shape == (77, 3)
    skin = CurvedSkin(found, S, groups=(1, 2, 3, 4))
    assert prepared(skin).electrode.max() == 3
    with pytest.raises(ValueError, match="has no group 7; it has 0, 1, 2, 3, 4"):
        prepared(replace(skin, groups=(1, 2, 3, 7)))
    for wrong in (np.where(tag == 4, 4.7, tag), np.where(tag == 4, np.nan, tag), np.column_stack([tag, tag])):
        meshio.write(tmp_path / "wrong.vtu", meshio.Mesh(nodes, [("triangle", cells)], cell_data={"group": [wrong]}))
        with pytest.raises(InputFileError, match="'group' must hold one whole number a triangle"):
            read_triangles(tmp_path / "wrong.vtu")


def test_what_is_no_sheet_is_refused(tmp_path: Path) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]])
    for cells, kind, message in (([[0, 1, 2], [0, 1, 3], [0, 1, 4]], "triangle", "shared by three triangles"),
                                 ([[0, 1, 1]], "triangle", "have no area"), ([[0, 1, 4, 2]], "quad", "got quad")):
        meshio.write(tmp_path / "sheet.vtu", meshio.Mesh(points, [(kind, np.array(cells))]))
        with pytest.raises(InputFileError, match=message):
            read_triangles(tmp_path / "sheet.vtu")
    points[1, 2] = np.nan
    meshio.write(tmp_path / "sheet.vtu", meshio.Mesh(points, [("triangle", np.array([[0, 1, 2]]))]))
    with pytest.raises(InputFileError, match=r"node 1 \(from 0\) is not finite"):
        read_triangles(tmp_path / "sheet.vtu")


@pytest.mark.parametrize(("name", "text", "reason"), [
    ("sheet.vtu", "no mesh", "as vtu"), ("sheet.msh", "no mesh", "as either of ansys, gmsh"),
    ("sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", r"node 8 \(from 0\), which it does not have"),
    ("sheet.off", "", "as off"), ("sheet.doc", "", "file format")])
def test_a_mesh_that_cannot_be_read_is_named_with_the_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                                             name: str, text: str, reason: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputFileError, match=reason) as raised:
        read_triangles(tmp_path / name)
    assert raised.value.path == tmp_path / name
    assert capsys.readouterr() == ("", "")


def test_open_edges_that_nearly_touch_are_refused_and_seams_within_rounding_are_closed(skins: ModuleType,
                                                                                       tmp_path: Path) -> None:
    nodes, cells, _ = skins.sheet(np.linspace(0, 2 * np.pi, 33), np.linspace(0, 0.08, 9), lambda s, z: np.column_stack(
        [0.05 * np.cos(s), 0.05 * np.sin(s), z]))

    def read(nodes: Array, cells: Array) -> TriangleMesh:
        meshio.write(tmp_path / "tube.obj", meshio.Mesh(1e3 * nodes, [("triangle", cells)]))
        return read_triangles(tmp_path / "tube.obj")

    seam = np.zeros(nodes.shape)
    seam[-9:, 0] = 1.0  # nodes of the last column, which lie on those of the first
    assert len(read(nodes + 5e-8 * seam, cells).nodes_m) == 32 * 9  # 0.05 um, 5e-7 of the size
    with pytest.raises(InputFileError, match=r"18 nodes .* \(50.*\) and \(50.*\) mm, 0.001 mm from it.*Weld"):
        read(nodes + 1e-6 * seam, cells)
    assert len(read(nodes + 1e-4 * seam, cells).nodes_m) == 33 * 9  # a slit of 0.1 mm, edges of 10 mm
    plane = [skins.sheet(np.linspace(0, side, 3), np.linspace(0, 0.08, rows),
                         lambda s, z: np.column_stack([s, z, 0 * s]))
             for side, rows in ((0.02, 9), (-0.02, 17))]
    with pytest.raises(InputFileError, match=r"8 nodes on open edges"):  # in the middles of 8 edges
        read(np.vstack([plane[0][0], plane[1][0]]), np.vstack([plane[0][1], plane[1][1] + len(plane[0][0])]))


def test_short_edges_at_long_ones_and_narrow_strips_are_no_slits(skins: ModuleType, tmp_path: Path) -> None:
    turn = np.linspace(0, np.pi, 40)
    rim = np.column_stack([0.0002 * np.sin(turn), -0.0002 * np.cos(turn), 0 * turn])
    strip = np.vstack([[[-0.1, 0, 0]], rim])  # a wedge with a round end whose facets are 1e-4 of its sides
    wedge = np.column_stack([np.zeros(39, int), np.arange(1, 40), np.arange(2, 41)])
    narrow, cells, _ = skins.sheet(np.linspace(0, 0.1, 5), np.linspace(0, 1e-4, 2),
                                   lambda s, z: np.column_stack([s, z, z]))
    for points, triangles in ((strip, wedge), (narrow, cells)):
        meshio.write(tmp_path / "strip.obj", meshio.Mesh(1e3 * points, [("triangle", triangles)]))
        assert len(read_triangles(tmp_path / "strip.obj").nodes_m) == len(points)


def test_a_file_is_read_in_its_unit(skin_file: Path) -> None:
    text = skin_file.read_text(encoding="utf-8").replace('"sheet.stl"', '"sheet.stl"\nunit_mm = 10')
    skin_file.write_text(text, encoding="utf-8")
    assert np.ptp(read_curved_skin(skin_file).mesh.nodes_m[:, 0]) == pytest.approx(1.2)
