"""Derivatives of readings by touches and cards: against differences of full solutions, by scaling, by symmetry."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from subprocess import CompletedProcess

import numpy as np
import pytest

from eitsim.electrics.cem.adjoint import impedance_by_field
from eitsim.electrics.cem.assembly import SkinMesh, impedance, potentials, quadrature_points
from eitsim.electrics.cem.ring_scattering import reaches
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.mesh.symmetric_mesh import alike_mesh
from eitsim.mechanics.axisymmetric.indentation import equilibrium
from eitsim.mechanics.axisymmetric.solve_axisymmetric import reached
from eitsim.mechanics.rim.solve_near_rim import COARSE as COARSE_RIM
from eitsim.mechanics.rim.solve_near_rim import rim_change
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.outline import Outline
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Accuracy, Body, Electrodes, Hold, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import touched_conductance
from eitsim.simulation.derivatives.conductance_variation import Variation, conductance_change, moved, variations
from eitsim.simulation.derivatives.readings import Sensitivity, scene_sensitivity, write_sensitivity
from eitsim.simulation.derivatives.tangent import Settled, changed, rim_line, sampled, settled
from eitsim.simulation.near_edges import solve_near_rim
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony

FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
CARD = MaterialCard(name="made up", law=FOAM, conductivity=LAW)
PUNCH = Punch(0.03, 0.02, 0.014, 1.0)
# Element size of the tests, m: twice the default.
COARSE = 1.2e-4
LINES, PATCHES = Electrodes(), Electrodes(kind="patch")


@lru_cache(maxsize=4)
def base(punch: Punch = PUNCH) -> Settled:
    return settled(FOAM, Body(), punch, element_m=COARSE)


@lru_cache(maxsize=4)
def mesh(punch: Punch = PUNCH, electrodes: Electrodes = LINES) -> SkinMesh:
    return alike_mesh(Body(), electrodes, ((punch, base(punch).touch),))


@lru_cache(maxsize=4)
def varied(punch: Punch = PUNCH, free_m: float = 0.1) -> dict[str, Variation]:
    return {v.name: v for v in variations(mesh(punch).nodes_m, [base(punch)], LAW,
                                           reaches(Body(Disc(free_m)), [(punch, base(punch).touch)]))}


def adjoint(variation: Variation, punch: Punch = PUNCH) -> np.ndarray:
    touched = touched_conductance(quadrature_points(mesh(punch)), [(punch, base(punch).touch)], Skin(), LAW)
    potential = potentials(mesh(punch), touched, 1.0)
    return impedance_by_field(mesh(punch), potential, conductance_change(mesh(punch), Skin(), variation))


def slope(of: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """Derivative at 0 by differences of fourth order."""
    return (8 * (of(step) - of(-step)) - (of(2 * step) - of(-2 * step))) / (12 * step)


def distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def solved(name: str, touch: tuple, by: float, law: Conductivity = LAW) -> np.ndarray:
    """Full solution on the mesh moved by that much of a parameter."""
    at = moved(mesh(), varied()[name].velocity, by)
    return impedance(at, touched_conductance(quadrature_points(at), [touch], Skin(), law), 1.0)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_derivative_by_place_is_that_of_full_solutions(axis: str):
    def at(by_mm: float) -> np.ndarray:
        punch = replace(PUNCH, **{f"{axis}_m": getattr(PUNCH, f"{axis}_m") + by_mm / 1e3})
        return solved(f"{axis}_mm", (punch, base().touch), by_mm)

    # a point of quadrature lies within 1e-3 mm of the contact's end, across which the conductance jumps
    assert distance(adjoint(varied()[f"{axis}_mm"]), slope(at, 2e-4)) < 1e-6


def test_derivative_by_place_is_exact_on_a_mesh_that_stays_too():
    still = replace(varied()["x_mm"], velocity=np.zeros_like(mesh().nodes_m))

    def at(by_mm: float) -> np.ndarray:
        touch = (replace(PUNCH, x_m=PUNCH.x_m + by_mm / 1e3), base().touch)
        return impedance(mesh(), touched_conductance(quadrature_points(mesh()), [touch], Skin(), LAW), 1.0,
                         refinements=2)

    assert distance(adjoint(still), slope(at, 2e-4)) < 1e-6


def resolved(law: Hyperfoam, punch: Punch, by_load: float = 0.0) -> tuple:
    """The touch solved again on the same mesh of the foam, carried along."""
    model, force = changed(base(), law, punch)
    state = equilibrium(model, force * (1 + by_load), base().state.x, tolerance=1e-12)
    return punch, sampled(base(), model, state.x)


def test_patches_stay_where_they_are():
    at_rest, z = mesh(PUNCH, PATCHES), 1e-2
    found = {v.name: v for v in variations(
        at_rest.nodes_m, [base()], LAW, reaches(Body(Disc(0.09)), [(PUNCH, base().touch)]))}["x_mm"]

    def at(by_mm: float) -> np.ndarray:
        on = moved(at_rest, found.velocity, by_mm)
        touch = (replace(PUNCH, x_m=PUNCH.x_m + by_mm / 1e3), base().touch)
        return impedance(on, touched_conductance(quadrature_points(on), [touch], Skin(), LAW), z)

    field = touched_conductance(quadrature_points(at_rest), [(PUNCH, base().touch)], Skin(), LAW)
    change = conductance_change(at_rest, Skin(), found)
    assert distance(impedance_by_field(at_rest, potentials(at_rest, field, z), change), slope(at, 1e-3)) < 1e-6


@pytest.mark.parametrize(("name", "step"), [("F_N", 1e-4), ("d_mm", 1e-3), ("mu_1_Pa", 0.5), ("alpha_2", 1e-4)])
def test_derivative_through_the_mechanics_is_that_of_full_solutions(name: str, step: float):
    def touch(by: float) -> tuple:
        if name == "F_N":
            return resolved(FOAM, PUNCH, by)
        if name == "d_mm":
            return resolved(FOAM, replace(PUNCH, diameter_m=PUNCH.diameter_m + by / 1e3))
        if name == "mu_1_Pa":
            return resolved(replace(FOAM, mu_Pa=FOAM.mu_Pa + by * np.array([1.0, 0, 0])), PUNCH)
        return resolved(replace(FOAM, alpha=FOAM.alpha + by * np.array([0, 1.0, 0])), PUNCH)

    assert distance(adjoint(varied()[name]), slope(lambda by: solved(name, touch(by), by), step)) < 1e-6


@pytest.mark.parametrize("i", [0, 1, 2])
def test_derivative_by_the_skins_coefficients_is_that_of_full_solutions(i: int):
    def at(by: float) -> np.ndarray:
        return solved(f"a_{i + 1}", (PUNCH, base().touch), 0.0, replace(LAW, a=LAW.a + by * np.eye(3)[i]))

    assert distance(adjoint(varied()[f"a_{i + 1}"]), slope(at, 1e-2)) < 1e-6


AT_DEPTH = replace(PUNCH, force_N=None, depth_m=0.002)


@pytest.mark.parametrize(("name", "field"), [("depth_mm", "depth_m"), ("d_mm", "diameter_m")])
def test_derivatives_of_a_touch_of_given_depth_are_those_of_touches_pressed_to_it(name: str, field: str):
    velocity, step_mm = varied(AT_DEPTH)[name].velocity, 1e-3

    def at(by_mm: float) -> np.ndarray:
        punch = replace(AT_DEPTH, **{field: getattr(AT_DEPTH, field) + by_mm / 1e3})
        model, force = changed(base(AT_DEPTH), FOAM, punch)
        near = equilibrium(model, force, base(AT_DEPTH).state.x, tolerance=1e-12)
        touch = sampled(base(AT_DEPTH), model, reached(model, punch.depth_m / Body().thickness_m, near).x)
        on = moved(mesh(AT_DEPTH), velocity, by_mm)
        return impedance(on, touched_conductance(quadrature_points(on), [(punch, touch)], Skin(), LAW), 1.0)

    difference = (at(step_mm) - at(-step_mm)) / (2 * step_mm)
    assert distance(adjoint(varied(AT_DEPTH)[name], AT_DEPTH), difference) < 1e-5


def test_at_a_kept_depth_stiffness_does_not_count():
    found = varied(AT_DEPTH)
    assert "F_N" not in found
    scaled = [mu * adjoint(found[f"mu_{i + 1}_Pa"], AT_DEPTH) for i, mu in enumerate(FOAM.mu_Pa)]
    assert np.linalg.norm(sum(scaled)) < 1e-5 * np.linalg.norm(scaled[0])


@lru_cache(maxsize=2)
def sensitivity(scene: Scene, halvings: int = 1) -> Sensitivity:
    return scene_sensitivity(scene, CARD, halvings=halvings)


def column(of: Sensitivity, name: str) -> np.ndarray:
    return of.touched_by[:, of.parameters.index(name)]


def columns(of: Sensitivity, name: str) -> np.ndarray:
    """(2, readings) derivatives of readings and of what the touches change of them."""
    return np.stack([by[:, of.parameters.index(name)] for by in (of.touched_by, of.signal_by)])


def test_stiffer_foam_is_as_a_smaller_force():
    found = sensitivity(Scene(punches=(PUNCH,)))
    by_scale = sum(mu * column(found, f"mu_{i + 1}_Pa") for i, mu in enumerate(FOAM.mu_Pa))
    assert distance(by_scale, -PUNCH.force_N * column(found, "F_N")) < 1e-5


def test_readings_are_homogeneous_of_degree_one_in_resistances():
    found = sensitivity(Scene(punches=(PUNCH,)))
    by_contact = sum(column(found, f"z_{k}_Ohm_m") for k in range(16))
    assert distance(by_contact * 1.0 - LAW.c0_S_per_m * column(found, "c0_S_per_m"), found.touched_V) < 1e-11


def without_mesh(scene: Scene, touch: Touch, punch: Punch, electrodes: Electrodes) -> np.ndarray:
    """(2, readings) readings and what the touch changes of them, V, from the rim alone and the touch's multipoles."""
    got = solve(scene.body, scene.skin, electrodes, scene.drive, ((punch, touch),), LAW, method="multipole")
    return np.stack([got.touched_V.ravel(), got.signal_V.ravel()])


def with_contact(k: int, by_Ohm_m: float) -> Electrodes:
    """The default electrodes with one contact impedance changed."""
    z = np.ones(LINES.count)
    z[k] += by_Ohm_m
    return replace(LINES, contact_impedance_Ohm_m=tuple(z.tolist()))


@pytest.mark.thorough
def test_derivatives_are_those_of_a_solution_without_mesh():
    scene = Scene(punches=(PUNCH,))
    found, touch = sensitivity(scene, 2), settled(FOAM, scene.body, PUNCH).touch
    assert distance(found.signal_V, without_mesh(scene, touch, PUNCH, LINES)[1]) < 3e-4

    def moved_by(x_mm: float) -> np.ndarray:
        return without_mesh(scene, touch, replace(PUNCH, x_m=PUNCH.x_m + x_mm / 1e3), LINES)

    def contact_changed(k: int) -> Callable[[float], np.ndarray]:
        return lambda by_Ohm_m: without_mesh(scene, touch, PUNCH, with_contact(k, by_Ohm_m))

    changes = {"x_mm": (0.1, moved_by)} | {f"z_{k}_Ohm_m": (0.05, contact_changed(k)) for k in (0, 9)}
    for name, (step, at) in changes.items():
        by_difference = (at(step) - at(-step)) / (2 * step)
        apart = [distance(one, other) for one, other in zip(columns(found, name), by_difference, strict=True)]
        print(f"{name}: {apart[0]:.1e} of V, {apart[1]:.1e} of dV")
        assert max(apart) < (0.01 if name.startswith("z") else 1e-3)


def test_derivatives_of_mirrored_touches_are_even_by_x_and_odd_by_y():
    punch, mirror = replace(PUNCH, y_m=-PUNCH.y_m), -np.arange(16) % 16
    for name, sign in (("x_mm", 1), ("d_mm", 1), ("y_mm", -1)):
        derivative = adjoint(varied(punch)[name], punch)
        assert distance(sign * derivative[np.ix_(mirror, mirror)], adjoint(varied()[name])) < 1e-8


def test_file_holds_a_row_a_reading_and_a_column_a_parameter(tmp_path):
    found = sensitivity(Scene(punches=(PUNCH,)))
    write_sensitivity(found, tmp_path / "sens.csv")
    lines = [line.split(",") for line in (tmp_path / "sens.csv").read_text().splitlines()]
    assert lines[0] == ["reading", "value_V", *found.parameters]
    assert [lines[1][0], lines[209][0]] == ["v_000", "dv_000"]
    values = np.array([[float(cell) for cell in line[1:]] for line in lines[1:]])
    assert np.array_equal(values[:208, 1:], found.touched_by)
    assert np.array_equal(values[208:, 0], found.signal_V)


def test_readings_that_need_a_missing_electrode_have_no_derivative(tmp_path):
    found = sensitivity(Scene(punches=(PUNCH,), electrodes=Electrodes(missing=(3,))))
    assert "z_3_Ohm_m" not in found.parameters
    lost = np.isnan(found.touched_V)
    assert 0 < lost.sum() < len(lost)
    assert np.array_equal(np.isnan(found.touched_by), np.repeat(lost[:, None], len(found.parameters), axis=1))
    write_sensitivity(found, tmp_path / "sens.csv")
    rows = [line.split(",")[1:] for line in (tmp_path / "sens.csv").read_text().splitlines()[1:]]
    empty = np.array([[not cell for cell in row] for row in rows])
    assert np.array_equal(empty, np.repeat(np.tile(lost, 2)[:, None], 1 + len(found.parameters), axis=1))


@lru_cache(maxsize=1)
def at_the_rim() -> RimField:
    """What the rim changes of the touch from which the lines start."""
    return rim_change(FOAM, Body(), Punch(0.083, 0.0, 0.014, 1.0), COARSE_RIM).field


@pytest.mark.thorough
@pytest.mark.parametrize(("step", "within", "at"), [
    pytest.param(1e-4, 0.02, lambda by: (FOAM, Punch(0.083 + by, 0.0, 0.014, 1.0)), id="place"),
    pytest.param(0.02, 0.2, lambda by: (FOAM, Punch(0.083, 0.0, 0.014, 1.0 + by)), id="force"),
    pytest.param(1e-4, 0.2, lambda by: (FOAM, Punch(0.083, 0.0, 0.014 + by, 1.0)), id="diameter")])
def test_what_the_rim_changes_halfway_to_the_ends_of_its_line_is_on_it(step: float, within: float, at: Callable):
    here, line = at_the_rim(), rim_line(at_the_rim(), Body(), at(0.0)[1], at, step, COARSE_RIM)
    for side in (-0.5, 0.5):
        there, found = rim_change(FOAM, Body(), at(side * step)[1], COARSE_RIM).field, line.at(side * step)
        assert found.offset_m == pytest.approx(there.offset_m, abs=1e-12)
        assert found.radius_m == pytest.approx(there.radius_m, abs=2e-4)
        normal = np.interp(found.radius_m, there.radius_m, there.normal[:, 0])
        apart, moved_by = (np.linalg.norm(normal - one.normal[:, 0]) for one in (found, here))
        print(f"apart {apart / moved_by:.3f} of what the way there changes")
        assert apart < within * moved_by


@pytest.mark.slow
def test_derivatives_near_the_rim_are_those_of_scenes_solved_anew():
    punch = Punch(0.0584, 0.0438, 0.014, 1.0)
    scene = Scene(punches=(punch,))
    found = scene_sensitivity(scene, CARD)

    def signal(changed: Punch) -> np.ndarray:
        touch = solve_near_rim(FOAM, scene.body, changed)
        return solve(scene.body, scene.skin, scene.electrodes, scene.drive, ((changed, touch),), LAW,
                     method="mesh", signal=0.01).signal_V.ravel()

    apart = {}
    for name, field, step, unit in (("x_mm", "x_m", 3e-4, 1e3), ("y_mm", "y_m", 3e-4, 1e3),
                                    ("F_N", "force_N", 0.0075, 1.0), ("d_mm", "diameter_m", 2e-4, 1e3)):
        ends = [signal(replace(punch, **{field: getattr(punch, field) + by})) for by in (-step, step)]
        apart[name] = distance(column(found, name), (ends[1] - ends[0]) / (2 * step * unit))
    print(apart)
    assert max(apart.values()) < 0.025


@pytest.mark.slow
def test_derivatives_near_the_rim_by_contact_impedances_are_those_of_scenes_solved_anew():
    punch, step = Punch(0.0584, 0.0438, 0.014, 1.0), 0.05
    scene, touch = Scene(punches=(punch,)), solve_near_rim(FOAM, Body(), punch)
    found = scene_sensitivity(scene, CARD)

    def at(k: int, by_Ohm_m: float) -> np.ndarray:
        got = solve(scene.body, scene.skin, with_contact(k, by_Ohm_m), scene.drive, ((punch, touch),), LAW,
                    method="mesh", signal=5e-4)
        return np.stack([got.touched_V.ravel(), got.signal_V.ravel()])

    for k in (1, 2, 9):
        by_difference = (at(k, step) - at(k, -step)) / (2 * step)
        apart = [distance(*pair) for pair in zip(columns(found, f"z_{k}_Ohm_m"), by_difference, strict=True)]
        print(f"electrode {k}: {apart[0]:.1e} of V, {apart[1]:.1e} of dV")
        assert max(apart) < 0.015


@pytest.mark.slow
def test_several_touches_have_their_own_derivatives_and_one_foam():
    scene = Scene(punches=(PUNCH, Punch(-0.04, -0.02, 0.010, 0.3)))
    found = sensitivity(scene)
    assert found.parameters[:8] == ("x_mm_1", "y_mm_1", "F_N_1", "d_mm_1", "x_mm_2", "y_mm_2", "F_N_2", "d_mm_2")
    by_scale = sum(mu * column(found, f"mu_{i + 1}_Pa") for i, mu in enumerate(FOAM.mu_Pa))
    by_force = sum(punch.force_N * column(found, f"F_N_{i + 1}") for i, punch in enumerate(scene.punches))
    assert distance(by_scale, -by_force) < 1e-5


@pytest.mark.thorough
def test_on_a_disc_given_as_400_corners_derivatives_are_the_discs():
    turn = 2 * np.pi * (np.arange(400) + 0.5) / 400
    corners = 0.1 * np.sqrt(2 * np.pi / (400 * np.sin(2 * np.pi / 400))) * np.column_stack([np.cos(turn), np.sin(turn)])
    polygon = Body(Outline("polygon", points_m=tuple((x, y) for x, y in corners.tolist())))
    disc, found = (scene_sensitivity(Scene(body, (PUNCH,), electrodes=Electrodes(count=8)), CARD, halvings=1)
                   for body in (Body(), polygon))
    off = {name: distance(column(found, name), column(disc, name)) for name in disc.parameters}
    print(off)
    assert max(value for name, value in off.items() if not name.startswith("z_")) < 0.01
    assert max(off.values()) < 0.1  # by contact impedances, on a mesh that is not halved


GRID = Scene(Body(Outline("rectangle", width_m=0.14, height_m=0.1), 0.005),
             (Punch(0.011, 0.012, 0.010, 0.2),), electrodes=Electrodes(
    kind="surface", count=8, x_m=(-0.045, -0.015, 0.025, 0.05) * 2, y_m=(-0.025,) * 4 + (0.03,) * 4,
    width_m=0.005, contact_impedance_Ohm_m2=1e-4, shape="disc", soft=True))


@pytest.mark.slow
def test_between_electrodes_on_the_surface_derivatives_by_place_are_those_of_full_solutions():
    found, (punch,) = scene_sensitivity(GRID, CARD), GRID.punches
    touch = settled(FOAM, GRID.body, punch).touch

    def signal(x_m: float, y_m: float) -> np.ndarray:
        there = replace(punch, x_m=punch.x_m + x_m, y_m=punch.y_m + y_m)
        return solve(GRID.body, GRID.skin, GRID.electrodes, GRID.drive, ((there, touch),), LAW, method="mesh",
                     signal=5e-4).signal_V.ravel()

    step = 5e-4
    for name, way in (("x_mm", (step, 0)), ("y_mm", (0, step))):
        by_difference = (signal(*way) - signal(-way[0], -way[1])) / (2e3 * step)
        off = distance(column(found, name), by_difference)
        print(name, off)
        assert off < 0.02


@pytest.mark.parametrize(("punch", "named"), [
    (Punch(0.06, 0.012, 0.010, 0.2), "near the edge of an outline"),
    (Punch(0.02, 0.027, 0.010, 0.2), r"a contact that reaches an electrode, as touch 1 does number 6 \(from 0\)")])
def test_on_an_outline_contacts_that_reach_an_edge_or_an_electrode_are_refused(punch: Punch, named: str):
    with pytest.raises(ValueError, match=named):
        scene_sensitivity(replace(GRID, punches=(punch,), accuracy=Accuracy(0.1)), CARD)


@pytest.mark.parametrize(("scene", "named"), [
    (Scene(punches=(replace(PUNCH, friction="stick"),)), "friction"),
    (Scene(punches=(replace(PUNCH, conductor=True),)), "conductor"),
    (Scene(punches=(PUNCH,), hold=Hold((2.0,), "depth")), "hold"),
    (Scene(punches=(PUNCH, replace(PUNCH, x_m=0.0))), "together")])
def test_what_is_not_built_is_refused_with_its_reason(scene: Scene, named: str):
    card = replace(CARD, prony=Prony(np.array([0.3]), np.array([10.0])))
    with pytest.raises(ValueError, match=named):
        scene_sensitivity(scene, card)


@pytest.mark.thorough
def test_run_writes_the_file_and_refuses_before_solving(command: Callable[..., CompletedProcess[str]], tmp_path):
    write_card(CARD, tmp_path / "card.json")
    few = "[electrodes]\ncount = 8\n"
    (tmp_path / "scene.toml").write_text(f'card = "card.json"\n[punch]\nx_mm = 20\nforce_N = 0.5\n{few}')
    (tmp_path / "stick.toml").write_text('card = "card.json"\n[punch]\nfriction = "stick"\n')
    done = command("eitsim", "run", "scene.toml", "--sensitivity", "sens.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "sens.csv").read_text().startswith("reading,value_V,x_mm,y_mm,F_N,d_mm,mu_1_Pa")
    done = command("eitsim", "run", "stick.toml", "--sensitivity", "sens.csv", cwd=tmp_path)
    assert done.returncode == 2
    assert "sensitivities are not built for friction" in done.stderr
