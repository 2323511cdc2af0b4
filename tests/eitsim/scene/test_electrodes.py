"""Electrodes as they are given: places, widths, contact impedances, and those without contact."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from eitsim.electrics.forward.solve_forward import solve
from eitsim.scene.drive import Drive, read_out, voltage_columns
from eitsim.scene.electrodes import KINDS, Electrodes, among_all, arcs, contact_impedances, middles, present
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, Skin, scene_from, scene_tables
from eitsim.simulation.plan import make_plan
from eitsim.simulation.result_json import as_json
from eitsim.simulation.simulate import simulate
from eitsim.sweeps.dataset.parquet import write_part
from eitsim.sweeps.design.card_draws import Cards
from eitsim.sweeps.design.design import design_from, scene_at
from eitsim.sweeps.run.rows import solve_rows
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

LAW = Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4))
CARD = MaterialCard("Table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm"),
                    None, LAW)
PUNCH = Punch(0.03, 0.02)
SKIN = Skin(strain="normal")  # what `pressed` squeezes
SIXTEEN = np.degrees(np.pi / 8 * np.arange(16))


def pressed() -> Touch:
    """A touch that squeezes the skin under a punch of 14 mm to 0.7 of its thickness."""
    radius = np.linspace(0, 0.03, 121)
    normal = 1 - 0.3 / (1 + (radius / 0.007) ** 8)
    rest = np.ones_like(radius)
    return Touch(radius, 0 * rest, 0 * rest, rest, rest, normal, 0 * rest, 0.007, *[0.0] * 9, 0, (), 0.0)


def signal(electrodes: Electrodes, method: str = "multipole") -> np.ndarray:
    return solve(Body(), SKIN, electrodes, Drive(), ((PUNCH, pressed()),), LAW, method=method, signal=0.01).signal_V


def relative(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def test_line_electrodes_are_centred_counter_clockwise():
    ends = arcs(0.1, Electrodes(first_angle_rad=0.1))
    np.testing.assert_allclose(ends.mean(axis=1), 0.1 + np.pi / 8 * np.arange(16))
    np.testing.assert_allclose(np.diff(ends, axis=1), 0.1)


def test_each_electrode_keeps_what_it_is_given_and_comes_back():
    raw = {"count": 6, "angles_deg": [-10, 60, 130, 200, 270, 310], "width_mm": [5, 6, 7, 8, 9, 4], "missing": [2],
           "contact_impedance_Ohm_m": [1, 2, 3, float("inf"), 5, 6]}
    scene = scene_from({"electrodes": raw})
    assert scene.electrodes.missing == (2, 3)
    np.testing.assert_allclose(np.degrees(arcs(0.1, scene.electrodes).mean(axis=1)), raw["angles_deg"])
    np.testing.assert_allclose(np.diff(arcs(0.1, scene.electrodes))[:, 0], [0.05, 0.06, 0.07, 0.08, 0.09, 0.04])
    assert contact_impedances(scene.electrodes).tolist() == [1, 2, np.inf, np.inf, 5, 6]
    assert present(scene.electrodes).count == 4
    assert scene_from(scene_tables(scene)) == scene


@pytest.mark.parametrize(("raw", "named"), [
    ({"count": 3}, "count in .* must be 4 to 64, got 3"), ({"count": 65}, "4 to 64"),
    ({"kind": "ring"}, "'ring' is unknown; known: line, patch"), ({"width_mm": [10] * 15}, "width_mm.*16 numbers"),
    ({"width_mm": 39.28}, "electrodes 15 and 0|may be 39.269 wide at most"),
    ({"width_mm": [39.0] * 15 + [60.0]}, "overlap by .* mm; place them further from each other"),
    ({"contact_impedance_Ohm_m": 0}, "contact_impedance_Ohm_m .*positive"),
    ({"contact_impedance_Ohm_m": [1.0] * 15 + [-1.0]}, "positive, got -1"),
    ({"contact_impedance_Ohm_m": float("nan")}, "finite"), ({"contact_impedance_Ohm_m2": 1}, "no effect with kind"),
    ({"length_mm": 5}, "length_mm .*no effect"), ({"kind": "patch", "length_mm": 100}, "length_mm .*less than radius"),
    ({"missing": [16]}, "0 to 15, got 16"), ({"missing": [0.5]}, "missing"), ({"missing": [[]]}, "missing"),
    ({"missing": list(range(3, 16))}, "no reading"), ({"angles_deg": [0, 90, 180]}, "angles_deg .*16 numbers"),
    ({"count": 4, "angles_deg": [0, 180, 90, 270]}, "counter-clockwise"),
    ({"count": 4, "angles_deg": [0, 90, 180, 361]}, "one turn"),
    ({"count": 4, "angles_deg": [0, 90, 180, 270], "first_angle_deg": 5}, "first_angle_deg .*no effect"),
    ({"count": 4, "angles_deg": [0, 90, 180, 270], "clockwise": True}, "clockwise .*no effect with angles_deg")])
def test_electrodes_that_cannot_be_are_refused(raw: dict, named: str):
    with pytest.raises(ValueError, match=named):
        scene_from({"electrodes": raw})


def test_touching_neighbours_are_allowed():
    scene_from({"electrodes": {"width_mm": 200 * np.pi / 16}})


def test_a_list_of_equal_entries_is_the_number():
    listed = scene_from({"electrodes": {"contact_impedance_Ohm_m": [2.0] * 16, "width_mm": [10] * 16}}).electrodes
    assert relative(signal(listed), signal(Electrodes(contact_impedance_Ohm_m=2.0))) < 1e-12


def test_angles_given_evenly_are_the_even_ring():
    even = Electrodes(angles_rad=tuple(np.radians(SIXTEEN + 7)))
    assert relative(signal(even), signal(Electrodes(first_angle_rad=np.radians(7)))) < 1e-9


@pytest.mark.parametrize("method", ["multipole", "mesh"])
@pytest.mark.parametrize("each", [{}, {"width_m": tuple(np.linspace(0.004, 0.02, 16)), "missing": (3,)}])
def test_a_clockwise_ring_reads_as_the_mirrored_scene(each: dict, method: str):
    mirrored = replace(PUNCH, x_m=-PUNCH.x_m)
    clockwise = Electrodes(first_angle_rad=np.pi - 0.1, clockwise=True, **each)
    listed = replace(clockwise, first_angle_rad=0.0, clockwise=False, angles_rad=tuple(middles(clockwise) + 2 * np.pi))
    expected, *found = (solve(Body(), SKIN, one, Drive(), ((punch, pressed()),), LAW, method=method, signal=0.01)
                        for one, punch in ((Electrodes(first_angle_rad=0.1, **each), PUNCH), (clockwise, mirrored),
                                           (listed, mirrored)))
    for one in found:
        read = np.isfinite(expected.signal_V)
        far = relative(one.signal_V[read], expected.signal_V[read])
        print(f"{method}: {far:.1e}")
        np.testing.assert_allclose(one.baseline_V[read], expected.baseline_V[read], rtol=1e-9)
        assert far < (1e-9 if method == "multipole" else 1e-3)


def test_a_clockwise_ring_on_an_outline_is_the_list_in_descending_order():
    raw = {"body": {"outline": "rectangle", "width_mm": 80, "height_mm": 50}, "electrodes": {"count": 5, "width_mm": 4}}
    shares = [0.0, 0.8, 0.6, 0.4, 0.2]
    clockwise, listed = (scene_from({**raw, "electrodes": raw["electrodes"] | key}) for key in
                         ({"clockwise": True}, {"shares": shares}))
    assert clockwise == listed
    assert scene_from(scene_tables(clockwise)) == clockwise


@pytest.mark.parametrize("method", ["multipole", "mesh"])
def test_a_missing_electrode_takes_its_readings_and_no_current(method: str):
    """The others read as in the limit of a contact that lets nothing through, and as fifteen electrodes by themselves.
    """
    whole = Electrodes(missing=(5,))
    z = (1.0,) * 5 + (1e12,) + (1.0,) * 10
    found, limit = signal(whole, method), signal(replace(whole, missing=(), contact_impedance_Ohm_m=z), method)
    gone = np.isnan(found)
    assert np.flatnonzero(gone.all(axis=1)).tolist() == [4, 5, 6]
    assert all(gone[k].sum() == 1 for k in range(16) if k not in (4, 5, 6))
    print(f"{method}: {relative(found[~gone], limit[~gone]):.1e}")
    assert relative(found[~gone], limit[~gone]) < (1e-9 if method == "multipole" else 5e-4)


def test_the_matrix_of_those_present_stands_in_that_of_all():
    electrodes = Electrodes(count=5, missing=(1,))
    z = among_all(electrodes, np.arange(16.0).reshape(4, 4))
    assert np.isnan(z[1]).all()
    assert np.isnan(z[:, 1]).all()
    assert z[2, [0, 2, 3, 4]].tolist() == [4, 5, 6, 7]
    readings = read_out(Drive(), z)
    assert np.isnan(readings).tolist() == [[True, True], [True, True], [True, True], [False, True], [True, False]]


def test_what_is_lost_is_null_in_results_and_data_sets(tmp_path: Path):
    raw = {"punch": {"x_mm": 20, "force_N": 0.1}, "accuracy": {"signal": 0.2},
           "electrodes": {"count": 8, "missing": [2], "contact_impedance_Ohm_m": [1, 1, 1, 1, 2, 1, 1, 1]}}
    scene = scene_from(raw)
    result = json.loads(json.dumps(as_json(simulate(scene, CARD), scene, CARD), allow_nan=False))
    assert result["outcome"] == "ok"
    assert result["readings_V"][1] == result["readings_V"][2] == result["readings_V"][3] == [None] * 5
    assert [row.count(None) for row in result["baseline_V"]] == [1, 5, 5, 5, 1, 1, 1, 1]
    assert result["impedance_Ohm"][2] == [None] * 8
    path = write_part(tmp_path, solve_rows(design_from({"scenes": 1, **raw}), Cards(CARD), [0]))
    nulls = [parquet.read_table(path)[name].null_count for name in voltage_columns(40)]
    assert nulls == [value is None for row in result["readings_V"] for value in row]


@pytest.mark.parametrize(("raw", "named"), [
    ({"count": 4, "width_mm": 100 * np.pi / 2, "contact_impedance_Ohm_m": 1e-5}, "electrodes . and . .* leave a gap"),
    ({"count": 64, "width_mm": 9, "missing": [7]}, "63 electrodes that are not identical .* leave wider gaps")])
def test_the_plan_refuses_electrodes_whose_rim_is_not_solved(raw: dict, named: str):
    assert re.search(named, make_plan(scene_from({"electrodes": raw}), CARD).refusal)


def test_lists_of_electrodes_are_their_own_in_a_design_and_ranges_are_drawn():
    ring = {"count": 4, "width_mm": [10, 20, 10, 20], "angles_deg": [0, 80, 170, 280]}
    one, other = (scene_at(design_from({"scenes": 2, "electrodes": ring}), i).electrodes for i in (0, 1))
    assert one == other == scene_from({"electrodes": ring}).electrodes
    drawn = {"count": 8, "width_mm": [5, 20], "missing": {"choice": [[0], [3, 4]]}}
    rows = [scene_at(design_from({"scenes": 20, "electrodes": drawn}), i).electrodes for i in range(20)]
    assert {row.missing for row in rows} == {(0,), (3, 4)}
    assert len({row.width_m for row in rows}) == 20


@pytest.mark.parametrize("electrodes", [Electrodes(width_m=200e-3 * np.pi / 16), Electrodes(count=4, width_m=0.15)])
def test_rings_and_mesh_agree_where_electrodes_are_wide_or_touch(electrodes: Electrodes):
    rings, mesh = (solve(Body(), SKIN, electrodes, Drive(), ((PUNCH, pressed()),), LAW, method=method)
                   for method in ("multipole", "mesh"))
    print(f"{relative(mesh.signal_V, rings.signal_V):.1e}, estimated {mesh.signal_error:.1e}")
    assert relative(mesh.signal_V, rings.signal_V) < min(0.004, mesh.signal_error)


@pytest.mark.thorough
def test_a_kind_of_electrode_is_one_entry_where_a_known_one_lies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Foil at the rim: read from a scene file, checked, meshed and solved as patches are, under its own name."""
    monkeypatch.setitem(KINDS, "foil", KINDS["patch"])
    card = MaterialCard("foam", Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                        conductivity=Conductivity(30.0, [-2, 2, -1], (-0.4, 0.4)))
    given = {"contact_impedance_Ohm_m2": 1e-4, "length_mm": 5.0}
    foil, patch = (simulate(scene_from({"accuracy": {"signal": 0.1}, "electrodes": given | {"kind": kind}}), card)
                   for kind in ("foil", "patch"))
    assert foil.readings is not None
    assert patch.readings is not None
    np.testing.assert_array_equal(foil.readings.touched_V, patch.readings.touched_V)
    assert [one.decision for one in foil.plan.decisions] == [one.decision for one in patch.plan.decisions]
    with pytest.raises(ValueError, match='has no effect with kind = "foil"'):
        scene_from({"electrodes": {"kind": "foil", "contact_impedance_Ohm_m": 2.0}})
