"""Sheets in space under touches: flat ones are the flat skin, bent ones the flat ones, stretched ones by formulas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

from eitsim.electrics.curved.adapted_sheet import SheetReadings, readings_difference, solve_sheet
from eitsim.electrics.curved.solve_curved import facets_of, prepared, solve_curved_skin
from eitsim.electrics.curved.touched_sheet import ContactEnd, sheet_tensors, solve_touched
from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.drive import Drive, read_out
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, Skin
from eitsim.scene.triangles.triangle_files import TriangleMesh
from eitsim.sheet.sheet_conductance import principal_conductances, surface_metric
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

Array = NDArray[np.float64]
BODY = Body(Outline("rectangle", width_m=0.12, height_m=0.08), 0.01)
PUNCH = Punch(x_m=0.012, y_m=-0.006, force_N=1.0)
FOAM = Hyperfoam(np.array([9530.0]), np.array([8.0]), np.array([0.0]), "longterm")
LAW = Conductivity(30.0, np.array([-2.0, 2, -1]), (0, 0.4))


@pytest.fixture(scope="module")
def skins(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    """benchmarks/curved_skins.py, which makes the sheets."""
    return benchmark_module("curved_skins")


@pytest.fixture(scope="module")
def touch() -> Touch:
    return solve_touch(FOAM, BODY, PUNCH)


@dataclass(frozen=True)
class FlatField:
    """A flat touch as a field in space: places in its plane, and frames (n, 3, 3) there, by an isometry."""

    touch: Touch
    in_plane: Callable[[Array], tuple[Array, Array]]

    def near(self, points_m: Array) -> NDArray[np.bool_]:
        return np.ones(len(points_m), dtype=bool)

    def deformation_gradient(self, points_m: Array) -> Array:
        places, frames = self.in_plane(points_m)
        metric, normal = surface_metric(places, PUNCH, self.touch)
        squared, axes = np.linalg.eigh(metric)
        f = np.zeros((len(places), 3, 3))
        f[:, :2, :2] = np.einsum("nij,nj,nkj->nik", axes, np.sqrt(squared), axes)
        f[:, 2, 2] = normal
        return frames @ f @ np.swapaxes(frames, 1, 2)

    def displacement(self, points_m: Array) -> Array:
        return 0 * points_m


def changed(found: SheetReadings) -> Array:
    return found.touched_Ohm - found.impedance_Ohm


def test_a_touch_on_a_flat_sheet_in_space_is_that_of_the_flat_skin(skins: ModuleType, touch: Touch) -> None:
    first = skins.turned(np.eye(2))
    axes = np.vstack([first, np.cross(*first)]).T

    def in_plane(points_m: Array) -> tuple[Array, Array]:
        return points_m @ axes[:, :2], np.broadcast_to(axes, (len(points_m), 3, 3))

    skin, places = Skin(), skins.PLACES
    electrodes = Electrodes(kind="surface", count=8, width_m=0.01, x_m=tuple(places[:, 0]), y_m=tuple(places[:, 1]))
    flat = solve(BODY, skin, electrodes, Drive(), ((PUNCH, touch),), LAW, signal=1e-3, method="mesh")
    end = ContactEnd(tuple(axes[:, :2] @ [PUNCH.x_m, PUNCH.y_m]), touch.contact_radius_m, PUNCH.fillet_m)
    found = solve_touched(prepared(replace(skins.touched_sheet(), patches=())), np.full(8, 1e-2), skin, LAW,
                          FlatField(touch, in_plane), [end], 1e-4, 1e-3)
    signal = read_out(Drive(), changed(found))
    assert found.signal_error is not None
    assert found.signal_error < 1e-3
    assert np.linalg.norm(signal - flat.signal_V) < (
        found.signal_error + flat.signal_error) * np.linalg.norm(flat.signal_V)


def test_bending_a_touched_sheet_to_a_cylinder_changes_no_reading(skins: ModuleType, touch: Touch) -> None:
    radius, skin = 0.05, Skin(strain="areal")

    def bent(points_m: Array) -> tuple[Array, Array]:
        angle = np.arctan2(points_m[:, 0], points_m[:, 2])
        none, one = np.zeros_like(angle), np.ones_like(angle)
        frames = np.array([[np.cos(angle), none, np.sin(angle)], [none, one, none],
                           [-np.sin(angle), none, np.cos(angle)]])
        return np.column_stack([radius * angle, points_m[:, 1]]), np.moveaxis(frames, 2, 0)

    def flat(points_m: Array) -> tuple[Array, Array]:
        return points_m[:, :2], np.broadcast_to(np.eye(3), (len(points_m), 3, 3))

    columns, rows = np.linspace(-0.06, 0.06, 49), np.linspace(-0.04, 0.04, 33)
    found = []
    for in_plane, place in ((flat, lambda s, z: np.column_stack([s, z, 0 * s])),
                            (bent, lambda s, z: np.column_stack(
                                [radius * np.sin(s / radius), z, radius * np.cos(s / radius)]))):
        nodes, cells, middle = skins.sheet(columns, rows, place, quadratic=True)
        near = np.abs(middle[:, None] - skins.PLACES).max(axis=2) < 0.005
        facets = replace(facets_of(TriangleMesh("", nodes, cells, {})),
                         electrode=np.where(near.any(axis=1), near.argmax(axis=1), -1))
        found.append(solve_touched(facets, np.full(8, 1e-2), skin, LAW, FlatField(touch, in_plane), [], 1.0, 1.0))
    assert readings_difference(found[1].impedance_Ohm, found[0].impedance_Ohm) < 1e-5
    assert readings_difference(changed(found[1]), changed(found[0])) < 1e-5


def test_the_conductance_of_a_stretched_sheet_is_that_of_its_principal_stretches_in_any_frame() -> None:
    rng = np.random.default_rng(4)
    frame, turn = (np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(2))
    frame[:, 2] *= np.sign(np.linalg.det(frame))
    angle, (first, second, normal) = 0.7, (1.1, 0.9, 0.8)
    along = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    axes = frame @ np.block([[along, np.zeros((2, 1))], [np.zeros((1, 2)), np.ones((1, 1))]])

    class Stretched:
        def near(self, points_m: Array) -> NDArray[np.bool_]:
            return np.ones(len(points_m), dtype=bool)

        def deformation_gradient(self, points_m: Array) -> Array:
            return np.broadcast_to(turn @ axes @ np.diag([first, second, normal]) @ axes.T, (len(points_m), 3, 3))

        def displacement(self, points_m: Array) -> Array:
            return 0 * points_m

    for strain in ("normal", "principal", "areal"):
        skin = Skin(strain=strain)
        known = principal_conductances(LAW, skin, first, second, normal)
        # a sheet keeps its normal stretch along the deformed normal, whatever the body turns
        found = sheet_tensors(Stretched(), np.zeros((1, 3)), frame[None], skin, LAW)[0]
        np.testing.assert_allclose(found, along @ np.diag(known) @ along.T, rtol=1e-12)


@pytest.mark.thorough
def test_stated_errors_of_round_electrodes_hold_what_a_finer_cut_changes(skins: ModuleType,
                                                                         monkeypatch: pytest.MonkeyPatch) -> None:
    skin = replace(skins.touched_sheet(), patches=(), widths_m=0.024)
    rough = solve_curved_skin(skin, readings=1e-3)
    monkeypatch.setattr("eitsim.electrics.curved.rounds._CHORDS", 40)
    fine = solve_curved_skin(skin, readings=1e-5)
    assert readings_difference(rough.impedance_Ohm, fine.impedance_Ohm) < rough.readings_error


def test_triangles_are_halved_for_the_error_that_is_missed_alone(skins: ModuleType) -> None:
    """A coarse request leaves the sheet as it was cut; one for the signal halves few triangles more."""
    facets = prepared(skins.touched_sheet())
    states = [lambda mesh, sheet, parts, factor=factor: np.repeat(6e-4 * factor(sheet), parts)
              for factor in (lambda sheet: np.ones_like(sheet.factor), lambda sheet: sheet.factor)]

    def triangles(readings: float, signal: float) -> int:
        found = solve_sheet(facets, np.full(8, 1e-2), states[0], states[1], readings, signal)
        assert found.readings_error < readings
        assert found.signal_error is not None
        assert found.signal_error < signal
        return len(found.facets.cells)

    assert triangles(1e-3, 1e-2) == len(facets.cells)
    assert triangles(1e-3, 2e-5) < 7566  # 1.5 times the 5,044 triangles of a sheet that is cut four times as finely
