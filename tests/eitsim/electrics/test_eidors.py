"""EIDORS's models from MATLAB files: the same readings on the same triangles, and plain refusals."""

import json
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat, savemat
from scipy.sparse import csc_matrix

from eitsim.cli import main
from eitsim.electrics.cem.assembly import impedance
from eitsim.electrics.interop.eidors import read_eidors
from eitsim.electrics.interop.solve_file import Solved, solve_model
from eitsim.electrics.outline.triangles import refined, skin_mesh, triangulated
from eitsim.scene.drive import Drive, protocol, read_out
from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import Body, Electrodes, Scene
from touchcal.arrays import Array
from touchcal.errors import InputFileError

REFERENCE = Path(__file__).parents[3].parent / "shared" / "reference" / "eit"
needs_reference = pytest.mark.skipif(not REFERENCE.exists(), reason="the reference meshes are not beside the checkout")
CASES = {"homog": (1e-3, 1e-3), "concentric": (1e-3, 4e-3)}


def structures(rows: list[dict[str, Any]]) -> Array:
    """A MATLAB structure array (1, n)."""
    out = np.empty((1, len(rows)), dtype=object)
    out[0] = rows
    made = np.empty((1, len(rows)), dtype=[(name, object) for name in rows[0]])
    for k, row in enumerate(rows):
        made[0, k] = tuple(row.values())
    return made


def stimulation(drive: Drive, count: int) -> Array:
    asked = protocol(drive, count)
    return structures([{"stimulation": "Amp", "stim_pattern": csc_matrix(current[:, None]),
                        "meas_pattern": csc_matrix(weights)}
                       for current, weights in zip(asked.currents_A, asked.weights, strict=True)])


def square(parts: int = 1) -> dict[str, Any]:
    """A forward model of the unit square, its 72 triangles cut in `parts` each way, with an electrode on the fourth
    sixth of each side; numbers from 1."""
    side = 6 * parts
    x = np.linspace(0, 1, side + 1)
    nodes = np.array([(a, b) for b in x for a in x])
    corner = np.array([i + j * (side + 1) for j in range(side) for i in range(side)])
    cells = np.vstack([corner[:, None] + [0, 1, side + 2], corner[:, None] + [0, side + 2, side + 1]])
    along = np.arange(3 * parts, 4 * parts + 1)
    sides = [along, along * (side + 1) + side, side * (side + 1) + along, along * (side + 1)]
    electrodes = structures([{"nodes": own + 1.0, "z_contact": 0.01 * (1 + k)} for k, own in enumerate(sides)])
    return {"type": "fwd_model", "name": "square", "nodes": nodes, "elems": cells + 1.0, "electrode": electrodes,
            "gnd_node": 1.0, "stimulation": stimulation(Drive(1.0), 4)}


def saved(path: Path, **variables: Any) -> Path:
    savemat(path, variables)
    return path


@needs_reference
@pytest.mark.parametrize("name", ["r1", "r2"])
@pytest.mark.parametrize("case", CASES)
def test_a_model_from_a_matlab_file_reads_as_eidors_does(name: str, case: str, tmp_path: Path) -> None:
    file = np.load(REFERENCE / f"mesh_{name}.npz")
    outside, inside = CASES[case]
    electrodes = structures([{"nodes": np.unique(file["bedges"][file["belec"] == k]) + 1.0, "z_contact": 1.0}
                             for k in range(1, 17)])
    forward = {"type": "fwd_model", "nodes": file["nodes"], "elems": file["elems"] + 1.0, "electrode": electrodes,
               "boundary": file["bedges"] + 1.0, "stimulation": stimulation(Drive(), 16)}
    image = {"type": "image", "fwd_model": forward, "elem_data": np.where(file["region"] == 1, outside, inside)}
    model = read_eidors(saved(tmp_path / "model.mat", img=image))
    assert model.conductance_S is not None
    solved = solve_model(model.mesh, model.conductance_S, model.contact_impedance_Ohm_m, model.stimulation)
    expected = np.loadtxt(REFERENCE / f"eidors_{case}_{name}_single.csv", delimiter=",")
    assert np.abs(np.vstack(solved.readings_V) / expected - 1).max() < 1e-12
    truth = np.loadtxt(REFERENCE / f"analytic_{case}_single.csv", delimiter=",")
    true_error = np.linalg.norm(expected - truth) / np.linalg.norm(truth)
    assert solved.readings_error is not None
    print(f"{case} {name}: true error {true_error:.1e}, told {solved.readings_error:.1e}")
    assert true_error / 2 < solved.readings_error < 2 * true_error


def test_the_triangles_of_an_outline_go_through_a_matlab_file(
        tmp_path: Path, benchmark_module: Callable[[str], ModuleType]) -> None:
    """Written, read and solved: the matrix of the outline's own mesh, and that of EIDORS' formulas (not EIDORS)."""
    body = Body(Outline("rectangle", width_m=0.12, height_m=0.08))
    lines = Scene(body, electrodes=Electrodes(count=8, width_m=0.01)).electrodes
    triangles = refined(triangulated(body.outline, lines), lambda places_m: np.full(len(places_m), 2e-5))
    mesh, z = skin_mesh(triangles, lines, "P1"), np.linspace(0.5, 2.0, 8)
    sheet = 6e-4 * (1 + np.arange(len(mesh.cells)) % 7)
    parts = structures([{"nodes": np.unique(mesh.under[mesh.electrode == k]) + 1.0, "z_contact": z[k]}
                        for k in range(8)])
    forward = {"type": "fwd_model", "nodes": mesh.nodes_m, "elems": mesh.cells + 1.0, "electrode": parts,
               "stimulation": stimulation(Drive(), 8)}
    model = read_eidors(saved(tmp_path / "model.mat", img={"fwd_model": forward, "elem_data": sheet}))
    np.testing.assert_array_equal(model.mesh.cells, mesh.cells)
    np.testing.assert_array_equal(model.mesh.nodes_m, mesh.nodes_m)
    assert model.conductance_S is not None
    found = solve_model(model.mesh, model.conductance_S, model.contact_impedance_Ohm_m).impedance_Ohm
    formulas = benchmark_module("eidors_formulas").impedance_by_eidors_formulas(mesh, sheet, z)
    for known in (impedance(mesh, sheet, z), formulas):
        assert np.abs(found - known).max() < 1e-11 * np.abs(known).max()


def test_a_file_that_eidors_wrote_reads_as_eidors_does() -> None:
    """See eidors_image.m, which wrote it; the named drive has EIDORS's signs, in the order of its rotate_meas."""
    path = Path(__file__).with_name("eidors_image.mat")
    model, meas = read_eidors(path), loadmat(path)["meas"].ravel()
    assert (model.name, model.mesh.count, len(model.mesh.cells)) == ("img", 16, 256)
    assert model.conductance_S is not None
    solved = solve_model(model.mesh, model.conductance_S, model.contact_impedance_Ohm_m, model.stimulation)
    found = np.concatenate([part.ravel() for part in solved.readings_V])
    named = read_out(Drive(reading="differential"), solved.impedance_Ohm).ravel()
    for readings in (found, named):
        assert np.abs(readings - meas).max() < 1e-13 * np.abs(meas).max()


def test_fields_are_read_from_one_on_and_the_boundary_is_found(tmp_path: Path) -> None:
    bare, forward = read_eidors(saved(tmp_path / "a.mat", fmdl=square())), square()
    edges = np.vstack([[1, 2], [5, 6], bare.mesh.under + 1])
    forward["boundary"] = np.vstack([edges, edges[0] + 20])
    given = read_eidors(saved(tmp_path / "b.mat", fmdl=forward))
    assert sorted(map(sorted, given.mesh.under.tolist())) == sorted(map(sorted, bare.mesh.under.tolist()))
    assert bare.name == "fmdl"
    np.testing.assert_allclose(bare.contact_impedance_Ohm_m, [0.01, 0.02, 0.03, 0.04])
    assert bare.conductance_S is None
    assert [asked.shape for asked in bare.stimulation] == [(1, 1)] * 4
    alone = read_eidors(saved(tmp_path / "c.mat", **square()))
    np.testing.assert_array_equal(alone.mesh.cells, bare.mesh.cells)


def test_stimulations_may_read_different_numbers(tmp_path: Path) -> None:
    forward = square()
    parts = [{"stimulation": "Amp", "stim_pattern": np.array([[1.0], [-1], [0], [0]]), "meas_pattern": weights}
             for weights in (np.array([[0, 0, 1.0, -1]]), np.array([[0, 1.0, -1, 0], [1.0, 0, 0, -1]]))]
    model = read_eidors(saved(tmp_path / "a.mat", fmdl=forward | {"stimulation": structures(parts)}))
    solved = solve_model(model.mesh, 0.5, model.contact_impedance_Ohm_m, model.stimulation)
    assert [part.shape for part in solved.readings_V] == [(1, 1), (1, 2)]
    voltage = solved.impedance_Ohm @ [1, -1, 0, 0]
    np.testing.assert_allclose(solved.readings_V[1], [[voltage[1] - voltage[2], voltage[0] - voltage[3]]])


def test_tensors_and_several_models(tmp_path: Path) -> None:
    forward = square()
    tensor = np.broadcast_to(0.5 * np.eye(2), (72, 1, 2, 2))
    path = saved(tmp_path / "a.mat", img={"fwd_model": forward, "elem_data": tensor},
                 other={"fwd_model": forward, "elem_data": np.full(72, 0.5)})
    with pytest.raises(InputFileError, match="several models: img, other"):
        read_eidors(path)
    one, other = (read_eidors(path, name) for name in ("img", "other"))
    assert one.conductance_S is not None
    assert one.conductance_S.shape == (72, 2, 2)
    z = [solve_model(m.mesh, m.conductance_S, m.contact_impedance_Ohm_m).impedance_Ohm for m in (one, other)
         if m.conductance_S is not None]
    np.testing.assert_allclose(z[0], z[1], rtol=1e-12, atol=1e-14)
    skew = np.broadcast_to([[1.0, 0.0], [5.0, 1.0]], (72, 2, 2))
    wrong = read_eidors(saved(tmp_path / "b.mat", img={"fwd_model": forward, "elem_data": skew}))
    assert wrong.conductance_S is not None
    with pytest.raises(ValueError, match="conductance must be symmetric"):
        solve_model(wrong.mesh, wrong.conductance_S, wrong.contact_impedance_Ohm_m)
    with pytest.raises(InputFileError, match="no forward model named 'third'; models in the file: img, other"):
        read_eidors(path, "third")


def test_the_error_told_is_that_of_linear_elements_and_quadratic_ones_beat_it(tmp_path: Path) -> None:
    def solved(parts: int, element: str) -> Solved:
        model = read_eidors(saved(tmp_path / "model.mat", fmdl=square(parts)))
        return solve_model(model.mesh, 1.0, model.contact_impedance_Ohm_m, model.stimulation, element=element)

    fine = solved(8, "P2")
    linear, quadratic = solved(1, "P1"), solved(1, "P2")
    errors = [float(np.linalg.norm(one.impedance_Ohm - fine.impedance_Ohm) / np.linalg.norm(fine.impedance_Ohm))
              for one in (linear, quadratic)]
    print(f"linear {errors[0]:.1e}, told {linear.impedance_error:.1e}, quadratic {errors[1]:.1e}")
    assert errors[0] / 2 < linear.impedance_error < 2 * errors[0]
    assert errors[1] < errors[0] / 2
    with pytest.raises(ValueError, match="element 'P3' is unknown; known: P1, P2"):
        solved(1, "P3")


def changed(**fields: Any) -> dict[str, Any]:
    return {"fmdl": {name: value for name, value in (square() | fields).items() if value is not None}}


def electrodes(**fields: Any) -> Array:
    rows = [{"nodes": np.array([3.0, 4.0]), "z_contact": 1.0} for _ in range(2)]
    return structures([rows[0] | {"nodes": np.array([1.0, 2.0])}, rows[1] | fields])


ONE = {"stim_pattern": np.array([1.0, -1, 0, 0]), "meas_pattern": np.array([0, 0, 1.0, -1])}


@pytest.mark.parametrize(("variables", "message"), [
    (changed(nodes=np.zeros((49, 3)), elems=np.ones((5, 4))), "3 coordinates and elements of 4 nodes; a sheet"),
    (changed(elems=np.array([[1.0, 2, 99]] * 2)), "elems names node 99; there are 49"),
    (changed(elems=np.array([[1.0, 2, 9]] * 2)), "node 3 belongs to no element"),
    (changed(elems=np.array([[1.5, 2, 9]] * 2)), "whole numbers of nodes"),
    (changed(electrode=None), "no field electrode"), (changed(electrode=electrodes(z_contact=0.0)), "electrode 2 is 0"),
    (changed(electrode=electrodes(z_contact=1 + 1j)), "z_contact is complex"),
    (changed(electrode=electrodes(nodes=25.0)), "node 25 of electrode 2 lies on no boundary edge"),
    (changed(electrode=electrodes(nodes=np.array([1.0, 2]))), "two electrodes cover the same edge"),
    (changed(stimulation=structures([ONE | {"stim_pattern": np.array([1.0, 0, 0, 0])}])), "stimulation 1: the curr"),
    (changed(stimulation=structures([ONE | {"meas_pattern": np.array([0, 0, 1.0, 0])}])), "against the ground node"),
    (changed(stimulation=structures([ONE | {"stim_pattern": np.ones(3)}])), "stim_pattern of 3 numbers"),
    (changed(stimulation=structures([ONE | {"volt_pattern": np.ones(4)}])), "has volt_pattern"),
    ({"img": {"fwd_model": square(), "elem_data": np.ones(7)}}, r"elem_data of shape \(7,\); 72 triangles"),
    ({"img": {"fwd_model": square(), "node_data": np.ones(49)}}, "holds node_data"),
    ({"x": 3.0}, "no forward model")])
def test_models_that_cannot_be_are_refused(variables: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=message):
        read_eidors(saved(tmp_path / "model.mat", **variables))


def test_files_that_are_not_read_say_how_to_save_them(tmp_path: Path) -> None:
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    (tmp_path / "new.mat").write_bytes(header + bytes(400))
    (tmp_path / "text.mat").write_text("nodes,elems\n" * 40)
    (tmp_path / "cut.mat").write_bytes(Path(__file__).with_name("eidors_image.mat").read_bytes()[:3000])
    for name, message in (("new", "save -v7"), ("text", "not a MATLAB file"), ("absent", "no such file"),
                          ("cut", "cut short")):
        with pytest.raises(InputFileError, match=message):
            read_eidors(tmp_path / f"{name}.mat")


def test_the_command_solves_a_model_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    path = saved(tmp_path / "model.mat", fmdl=square())
    (tmp_path / "scene.toml").write_text('[electrodes]\ncount = 4\n[drive]\nreading = "differential"\ncurrent_mA = 1\n')

    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["eitsim", "solve-mesh", str(path), *map(str, words)])
        status = 0
        try:
            main.main()
        except SystemExit as end:
            status = int(end.code or 0)
        out, err = capsys.readouterr()
        return status, out, err

    status, out, err = run("--conductance-S", "0.5", "--scene", tmp_path / "scene.toml", "--json")
    assert "only [drive] is used; [electrodes] left out" in err
    document = json.loads(out)
    assert status == 0
    z = np.array(document["impedance_Ohm"])
    np.testing.assert_allclose(document["readings_V"], read_out(Drive(1e-3, reading="differential"), z), rtol=1e-12)
    assert document["error_estimate"].keys() == {"impedance", "readings"}
    status, out, _ = run("--conductance-S", "0.5", "--element", "P2", "--out", tmp_path / "solved.json")
    assert status == 0
    assert "triangles" in out
    assert json.loads((tmp_path / "solved.json").read_text())["model"]["element"] == "P2"
    for words, message in (((), "--conductance-S"), (("--conductance-S", "-1"), "--conductance-S must be a positive"),
                           (("--conductance-S", "1", "--element", "Q2"), "known: P1, P2"),
                           (("--variable", "other"), "models in the file: fmdl")):
        status, out, err = run(*words)
        assert (status, out) == (2, "")
        assert message in err


def test_a_file_that_unpacks_to_far_more_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.mat"
    savemat(path, {"fwd_model": {"nodes": np.zeros(15_000_000)}}, do_compression=True)
    with pytest.raises(InputFileError, match=r"model\.mat: its \d+ bytes would unpack to 1\.2e\+08"):
        read_eidors(path)


def test_differential_readings_are_those_of_eidors_with_rotate_meas() -> None:
    """EIDORS sends the current the other way and reads the other way round: each reading is the same number."""
    own = protocol(Drive(reading="differential"), 16)
    written = loadmat(Path(__file__).with_name("eidors_image.mat"), struct_as_record=False, squeeze_me=True)["img"]
    for k, theirs in enumerate(written.fwd_model.stimulation):
        current, weights = theirs.stim_pattern.toarray().ravel(), theirs.meas_pattern.toarray()
        np.testing.assert_array_equal(np.einsum("e,rf->ref", current, weights),
                                      np.einsum("e,rf->ref", own.currents_A[k], own.weights[k]))
