"""Outlines from files: corners as CSV, drawings as DXF and SVG, meshes."""

import math
from pathlib import Path

import ezdxf
import meshio
import numpy as np
import pytest

from eitsim.scene.edges.outline_electrodes import middles_m
from eitsim.scene.polygons import area_m2
from eitsim.scene.scene import read_scene
from touchcal.errors import InputFileError

GROUPS = Path(__file__).parents[4] / "shared/cases/eit/20_gmsh_quads_and_groups/verify_2D_coarse.msh"

def scene_of(tmp_path, name, more=""):
    (tmp_path / "scene.toml").write_text(f'[body]\noutline = "{name}"\n{more}[electrodes]\ncount = 8\nwidth_mm = 2\n')
    return read_scene(tmp_path / "scene.toml")


def test_corners_of_a_csv_are_the_outline(tmp_path):
    (tmp_path / "skin.csv").write_text("x_mm,y_mm\n0,0\n60,0\n60,40\n0,40\n")
    body = scene_of(tmp_path, "skin.csv", "holes_mm = [[30, 20, 5]]\n").body
    assert body.outline.kind == "polygon"
    assert area_m2(body.outline) == pytest.approx(60e-3 * 40e-3 - math.pi * 5e-3**2)
    (tmp_path / "a.toml").write_text('[body]\noutline = "polygon"\npoints_mm = "skin.csv"\n')
    assert read_scene(tmp_path / "a.toml").body.outline.points_m == body.outline.points_m


def test_numbered_groups_of_lines_of_a_mesh_are_electrodes(tmp_path):
    """A rectangle of 40 x 20 mm in metres, electrodes on each side, the last one around a corner, not in order."""
    corner = np.array([[0, 0], [10, 0], [14, 0], [40, 0], [40, 8], [40, 12], [40, 20], [30, 20], [20, 20], [0, 20],
                       [0, 2], [20, 10]]) / 1e3
    triangles = [[k, (k + 1) % 11, 11] for k in range(11)]
    lines = {"e10": [[1, 2]], "e2": [[4, 5]], "e1": [[7, 6]], "e9": [[8, 9]], "e11": [[10, 0], [0, 1]]}
    tags = [np.repeat(range(1, 6), [len(ends) for ends in lines.values()]), np.full(11, 9)]
    meshio.Mesh(np.column_stack([corner, np.zeros(12)]), [("line", np.vstack(list(lines.values()))),
                ("triangle", triangles)], cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
                field_data={name: np.array([k, 1]) for k, name in enumerate(lines, start=1)}).write(
        tmp_path / "skin.msh", file_format="gmsh22")
    head = '[body]\noutline = "skin.msh"\nunit_mm = 1000\n[electrodes]\n'
    (tmp_path / "scene.toml").write_text(head + 'groups = "e"\n')
    scene = read_scene(tmp_path / "scene.toml")
    np.testing.assert_allclose(1e3 * np.array(scene.electrodes.width_m), [10, 4, 20, 4, 12])
    np.testing.assert_allclose(1e3 * middles_m(scene.body.outline, scene.electrodes),
                               [[35, 20], [40, 10], [10, 20], [12, 0], [4, 0]], atol=1e-9)
    for more, named in (("count = 8\n", 'groups = "e"'), ('groups = "f"\n', "it has e10, e2, e1, e9, e11"),
                        ('groups = "e"\ncount = 5\n', "no effect with groups")):
        (tmp_path / "scene.toml").write_text(head + more)
        with pytest.raises(ValueError, match=named):
            read_scene(tmp_path / "scene.toml")


@pytest.mark.skipif(not GROUPS.exists(), reason="the mesh of a public case is not here")
def test_twenty_named_electrodes_of_a_public_mesh(tmp_path):
    (tmp_path / "scene.toml").write_text(f'[body]\noutline = "{GROUPS}"\n[electrodes]\ngroups = "elec"\n')
    scene = read_scene(tmp_path / "scene.toml")
    mesh = meshio.read(GROUPS)
    for k, (x, y) in enumerate(1e3 * middles_m(scene.body.outline, scene.electrodes), start=1):
        lines = np.concatenate([block.data[tags == k] for block, tags in zip(
            mesh.cells, mesh.cell_data["gmsh:physical"], strict=True) if block.type == "line"])
        assert [x, y] == pytest.approx(mesh.points[lines][..., :2].mean(axis=(0, 1)), abs=1e-6)


def test_lines_and_arcs_of_a_dxf_are_joined_and_its_circles_are_holes(tmp_path):
    drawing = ezdxf.new(units=4)
    space = drawing.modelspace()
    space.add_line((0, 0), (60, 0))
    space.add_line((0, 40), (0, 0))
    space.add_arc((60, 20), 20, -90, 90)
    space.add_line((60, 40), (0, 40))
    space.add_circle((20, 20), 5)
    drawing.saveas(tmp_path / "skin.dxf")
    body = scene_of(tmp_path, "skin.dxf").body
    assert area_m2(body.outline) == pytest.approx((60 * 40 + math.pi * 20**2 / 2 - math.pi * 5**2) * 1e-6, rel=1e-3)
    space.add_line((100, 0), (120, 0))
    drawing.saveas(tmp_path / "skin.dxf")
    with pytest.raises(InputFileError, match="the outline is open at \\(120, 0\\) mm"):
        scene_of(tmp_path, "skin.dxf")


def test_paths_of_an_svg_are_in_millimetres_and_point_upwards(tmp_path):
    (tmp_path / "skin.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="60mm" viewBox="0 0 100 60">'
        '<path d="M 0 0 L 80 0 L 80 40 L 40 50 L 0 40 Z"/><circle cx="20" cy="20" r="6"/></svg>')
    body = scene_of(tmp_path, "skin.svg").body
    assert area_m2(body.outline) == pytest.approx((80 * 40 + 80 * 10 / 2 - math.pi * 6**2) * 1e-6, rel=1e-3)
    np.testing.assert_allclose(body.outline.loops[0].min(axis=0), [0, -0.05], atol=1e-6)


def test_user_units_of_an_svg_are_96_an_inch(tmp_path):
    (tmp_path / "skin.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" width="480" height="480">'
                                       '<path d="M 0 0 L 384 0 L 384 192 L 0 192 Z"/></svg>')
    assert area_m2(scene_of(tmp_path, "skin.svg").body.outline) == pytest.approx(0.1016 * 0.0508, rel=1e-9)


@pytest.mark.parametrize(("unit", "said"), [(1, "inches"), (6, "meters"), (4, None), (0, None)])
def test_a_drawing_in_another_unit_than_mm_is_refused(tmp_path, unit, said):
    drawing = ezdxf.new(units=unit)
    drawing.modelspace().add_lwpolyline([(0, 0), (120, 0), (120, 80), (0, 80)], close=True)
    drawing.saveas(tmp_path / "skin.dxf")
    if said is None:
        assert area_m2(scene_of(tmp_path, "skin.dxf").body.outline) == pytest.approx(0.12 * 0.08)
        return
    with pytest.raises(InputFileError, match=rf"it states {said} \(\$INSUNITS {unit}\).* Save it in mm"):
        scene_of(tmp_path, "skin.dxf")


def test_the_edge_of_a_mesh_is_the_outline(tmp_path):
    x, y = np.meshgrid(np.arange(7.0) * 10, np.arange(5.0) * 10)
    number = np.arange(35).reshape(5, 7)
    squares = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    squares = np.delete(squares, 8, axis=0)  # a hole
    triangles = np.vstack([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]])
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    meshio.Mesh(points, [("triangle", triangles)]).write(tmp_path / "skin.vtk")
    body = scene_of(tmp_path, "skin.vtk").body
    assert len(body.outline.holes_m) == 1
    assert area_m2(body.outline) == pytest.approx((60 * 40 - 100) * 1e-6)
    points[3, 2] = 5
    meshio.Mesh(points, [("triangle", triangles)]).write(tmp_path / "skin.vtk")
    with pytest.raises(InputFileError, match="curved skins are not solved; `eitsim solve-mesh`"):
        scene_of(tmp_path, "skin.vtk")


@pytest.mark.parametrize(("name", "content", "said"), [
    ("skin.csv", None, "no such file"), ("skin.csv", "x,y\n1\n", "1 columns, expected 2"),
    ("skin.dxf", "words", "no DXF file"), ("skin.stl", "words", "nor a mesh that meshio reads"),
])
def test_files_that_hold_no_outline_are_named(tmp_path, name, content, said):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(InputFileError, match=said):
        scene_of(tmp_path, name)


def _square(size: float, kind: str) -> meshio.Mesh:
    """A square of 4 x 4 cells about (0, 0), of quadrilaterals or of triangles."""
    x, y = np.meshgrid(np.linspace(-size / 2, size / 2, 5), np.linspace(-size / 2, size / 2, 5))
    at = np.array([[5 * j + i + np.array([0, 1, 6, 5]) for i in range(4)] for j in range(4)]).reshape(-1, 4)
    cells = at if kind == "quad" else np.vstack([at[:, [0, 1, 2]], at[:, [0, 2, 3]]])
    return meshio.Mesh(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]), [(kind, cells)])


@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_a_mesh_of_quadrilaterals_is_an_outline_as_one_of_triangles_is(tmp_path, kind):
    meshio.write(tmp_path / "skin.msh", _square(60, kind), file_format="gmsh22", binary=False)
    body = scene_of(tmp_path, "skin.msh").body
    assert area_m2(body.outline) == pytest.approx(60e-3**2)


@pytest.mark.parametrize(("unit", "unit_mm"), [(1e-3, 1000), (0.1, 10), (1 / 25.4, 25.4)])
def test_a_file_in_another_unit_is_read_with_unit_mm_and_asked_for_without(tmp_path, unit, unit_mm):
    meshio.write(tmp_path / "skin.msh", _square(60 * unit, "triangle"), file_format="gmsh22", binary=False)
    (tmp_path / "skin.csv").write_text("\n".join(f"{60 * x * unit!r},{60 * y * unit!r}"
                                                 for x, y in [(0, 0), (1, 0), (1, 1), (0, 1)]))
    for name in ("skin.msh", "skin.csv"):
        assert area_m2(scene_of(tmp_path, name, f"unit_mm = {unit_mm}\n").body.outline) == pytest.approx(60e-3**2)
    if 4 * 60 * unit < 8 * 2:
        with pytest.raises(InputFileError, match=r"skin.csv: it is .* large if its lengths are mm.*unit_mm = 1000"):
            scene_of(tmp_path, "skin.csv")


def test_a_unit_that_cannot_be_or_has_no_file_is_refused(tmp_path):
    (tmp_path / "skin.csv").write_text("0,0\n60,0\n60,40\n")
    with pytest.raises(ValueError, match=r"unit_mm in .body. must be a positive number"):
        scene_of(tmp_path, "skin.csv", "unit_mm = 0\n")
    with pytest.raises(ValueError, match=r"unit_mm in .body. has no effect without a file"):
        scene_of(tmp_path, "ellipse", "unit_mm = 1\nwidth_mm = 60\nheight_mm = 40\n")


def test_a_format_of_gmsh_that_is_not_read_is_named(tmp_path):
    (tmp_path / "skin.msh").write_text("$MeshFormat\n4 0 8\n$EndMeshFormat\n$Entities\n1 0 0 0\n1 0 0 0 0 0 0 0\n")
    with pytest.raises(InputFileError, match=r"its format is 4, .*save it as version 2.2"):
        scene_of(tmp_path, "skin.msh")
