"""Calls and sizes that cannot be meant: refused before the work, in the user's own words; what was assumed is said."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from matcal.card import MaterialCard, write_card
from matcal.cli.main import app
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.record.calibration import fit
from matcal.record.cautions import cautions
from matcal.reduction.loading_direction import densifies, named_direction
from matcal.reduction.reduce import reduce_tests
from touchcal.errors import InputFileError
from touchcal.terminal import _with_options, check_apart, check_out

DATA = Path(__file__).parents[3] / "data_raw"
CURVES = ("fit", str(DATA / "uniaxial.csv"), str(DATA / "shear.csv"))
FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))


def _called(*words: str) -> str:
    """What a call that must fail says."""
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - the caller looks at the words
        CliRunner().invoke(app, words, catch_exceptions=False)
    return _with_options(str(refused.value), app, {"weights": "--weight"})


@pytest.mark.parametrize(("flags", "says"), [
    (("--stable-range", "0.3,1.5"), "Add --stable drucker"), (("--prony-terms", "2"), "add relaxation=FILE"),
    (("--weight", "uniaxial=x"), "for example --weight uniaxial=2"),
    (("--weight", "shear=2", "--weight", "shear=3"), "given twice"),
    (("--stable", "drucker", "--stable-range", "x"), "for example --stable-range=0.3,1.5"),
    (("--poisson", "x"), "or one of fit, fit-each")])
def test_flags_without_effect_or_sense_are_refused_with_a_fitting_example(flags: tuple[str, ...], says: str,
                                                                          tmp_path: Path) -> None:
    assert says in _called(*CURVES, "--out", str(tmp_path / "card.json"), *flags)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("flags", [("--out", "uniaxial.csv"), ("--out", "a.json", "--report", "shear.csv"),
                                   ("--out", "data.json")])
def test_no_output_replaces_what_is_read(flags: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
                                         ) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data.d").mkdir()
    files = {Path(name): (DATA / Path(name).name).read_bytes() for name in ("uniaxial.csv", "shear.csv")}
    files[Path("data.d/uniaxial.json")] = files[Path("uniaxial.csv")]
    for path, content in files.items():
        path.write_bytes(content)
    said = _called("fit", "uniaxial.csv", "shear.csv", "uniaxial=data.d/uniaxial.json", *flags)
    assert " read" in said
    assert "Choose another name." in said
    assert {path: path.read_bytes() for path in files} == files
    found = fit(["uniaxial.csv", "shear.csv"], order=1)
    with pytest.raises(ValueError, match="which is read"):
        found.save("uniaxial.csv")


@pytest.mark.parametrize("flags", [("--order", "2"), ("--stable", "drucker"), ("--poisson", "0.1"),
                                   ("--residual", "absolute")])
def test_flags_about_the_law_need_a_curve(flags: tuple[str, ...], tmp_path: Path) -> None:
    e = np.linspace(0, 0.4, 30)
    path = tmp_path / "conductivity.csv"
    path.write_text("strain,conductivity\n-,S/m\n" + "".join(f"{x:.6g},{30 - 20 * x:.6g}\n" for x in e))
    assert f"{flags[0]} is about the law" in _called("fit", str(path), "--out", str(tmp_path / "card.json"), *flags)


def test_every_output_has_one_rule(tmp_path: Path) -> None:
    nowhere = tmp_path / "new" / "x"
    for words in ((*CURVES, "--out", str(nowhere)),
                  (*CURVES, "--out", str(tmp_path / "a.json"), "--report", str(nowhere)),
                  ("report", "none.json", "--out", str(nowhere)),
                  ("export", "none.json", "--to", "abaqus", "--out", str(nowhere))):
        assert "new does not exist. Create it first" in _called(*words)
    with pytest.raises(ValueError, match="is a folder, and a file is to be written there"):
        check_out(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="file is a file, and nothing can be written below it"):
        check_out(tmp_path / "file" / "deep" / "x")
    with pytest.raises(ValueError, match="is a file, and a folder"):
        check_out(tmp_path / "file", folder=True)
    check_out(tmp_path / "model", folder=True)


def test_a_folder_that_is_no_earlier_fit_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "thesis.d").mkdir()
    (tmp_path / "thesis.d" / "chapter.tex").write_text("years of work")
    assert "which holds chapter.tex" in _called(*CURVES, "--out", str(tmp_path / "thesis.json"))
    assert (tmp_path / "thesis.d" / "chapter.tex").exists()


def test_inspect_takes_a_kind(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("strain,stress\n-,Pa\n0,0\n0.1,1\n")
    found = json.loads(CliRunner().invoke(app, ["inspect", f"planar={path}", "--json"]).stdout)[str(path)]
    assert (found["kind"], found["kind_reason"]) == ("planar", "a.csv: planar, as given.")
    assert "'x' is unknown" in _called("inspect", f"x={path}")


@pytest.mark.parametrize(("sizes", "says"), [
    ("diameter_mm = 0.05\nheight_mm = 0.02", "Check height_mm, in mm"),
    ("diameter_mm = 0.05\nheight_mm = 20", "more than any foam bears. Check diameter_mm"),
    ("diameter_mm = 50\nheight_mm = 2000", "is a strain of 0.0.* Check height_mm"),
    ("diameter_mm = 50\nheight_mm = 20\ncompliance_mm_per_N = 1.0", r"Check compliance_mm_per_N = 1: it is in mm/N"),
])
def test_sizes_that_cannot_be_are_named(sizes: str, says: str, tmp_path: Path) -> None:
    specimen = tmp_path / "s.toml"
    specimen.write_text(f"[uniaxial]\n{sizes}\n")
    with pytest.raises(InputFileError, match=says):
        reduce_tests([("uniaxial", (DATA / "mts_uniaxial.txt",))], specimen)


def _table(folder: Path, name: str, head: str = "strain,stress") -> Path:
    e = np.linspace(-0.01, -0.8, 60)
    p = nominal_stress(FOAM, "uniaxial", e)
    path = folder / name
    path.write_text(f"{head}\n-,Pa\n" + "".join(f"{-x:.6g},{-y:.6g}\n" for x, y in zip(e, p, strict=True)))
    return path


def test_a_direction_that_nothing_tells_is_said_and_warned_of(tmp_path: Path) -> None:
    read, = reduce_tests([("uniaxial", (_table(tmp_path, "foam.csv"),))])
    assert read.strain.max() > 0.7
    said, = [s for s in read.cautions if "Nothing tells compression from tension in foam.csv" in s]
    assert "as that of foam does in compression" in said
    card = MaterialCard("a", None, None, None, provenance={"cautions": [said]})
    assert said in cautions(card)
    for name, head in (("druckversuch.csv", "strain,stress"), ("foam.csv", "compressive strain,stress")):
        read, = reduce_tests([("uniaxial", (_table(tmp_path, name, head),))])
        assert read.strain.max() < 0
    read, = reduce_tests([("uniaxial", (_table(tmp_path, "zugversuch.csv"),))])
    assert "Tension, by its name." in read.decisions


def test_words_and_shape_of_a_direction() -> None:
    assert named_direction(["Zugversuch 3"]) == "tension"
    assert named_direction(["压缩"]) == "compression"
    assert named_direction(["foam_UC_2"]) == "compression"
    assert named_direction(["tension after compression"]) is None
    e = np.linspace(0.01, 0.8, 60)
    assert densifies(e, -nominal_stress(FOAM, "uniaxial", -e))
    assert not densifies(e, 1e4 * e)
    assert not densifies(e, 1e4 * (1 - np.exp(-3 * e)))


def test_a_nu_that_is_left_open_is_among_the_cautions() -> None:
    card = MaterialCard("a", replace(FOAM, nu=np.full(3, 0.2)), None, None)
    assert not any("not determined" in s for s in cautions(card))
    fitted = {"nu": {"how": "fit", "value": 0.2, "interval": [-0.4, 0.31], "bounds": [-0.4, 0.4999]},
              "not_determined": ["nu"]}
    assert any("its 95 % interval is -0.4 to 0.31" in s for s in cautions(replace(card, fit=fitted)))


def test_what_is_read_is_not_overwritten_and_files_are_kept_apart(tmp_path: Path) -> None:
    card, other = tmp_path / "card.json", tmp_path / "other.csv"
    check_apart({"--out": other, "--report": None}, [card])
    with pytest.raises(ValueError, match=r"--frames .*card\.json would be overwritten: .*card\.json is read"):
        check_apart({"--frames": tmp_path / "." / "card.json"}, [card])
    with pytest.raises(ValueError, match=r"--skin .* would be overwritten: --out .* is written"):
        check_apart({"--out": other, "--skin": other}, [card])


def test_an_unknown_mode_is_named_with_the_known_ones(tmp_path: Path) -> None:
    write_card(MaterialCard("foam", FOAM), tmp_path / "card.json")
    assert "mode 'tension' is unknown; known: uniaxial," in _called("predict", str(tmp_path / "card.json"), "tension")
