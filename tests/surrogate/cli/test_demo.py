"""`touchcal demo`: a page to press and a touch, from nothing but the installed packages."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from typer.testing import CliRunner

import eitsim
import matcal
from surrogate.cli.demo_command import CARD, PAGE, SCENE, app
from surrogate.live.export_page import export_page
from touchcal.errors import InputFileError


def learned(page: Path) -> dict[str, Any]:
    """What a page's script reads."""
    found = re.search(r'id="learned">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return json.loads(found[1])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """The folder of a demo, and what it said."""
    folder = tmp_path_factory.mktemp("demo") / "first"
    return folder, CliRunner().invoke(app, ["demo", "--out", str(folder), "--no-browser"], catch_exceptions=False)


def test_a_page_and_a_touch_are_made_of_nothing(made: tuple[Path, Result]) -> None:
    folder, ran = made
    assert ran.exit_code == 0, ran.output
    assert len(ran.output.splitlines()) < 20
    assert "made-up" in ran.output
    result = eitsim.simulate(eitsim.read_scene(folder / SCENE), matcal.read_card(folder / CARD))
    assert f"{1e3 * result.touches[0].depth_m:.2f} mm" in ran.output


def test_the_page_of_the_demo_has_what_an_exported_page_has(made: tuple[Path, Result], inner_model: Any,
                                                            tmp_path: Path) -> None:
    export_page(inner_model, tmp_path / "own.html")
    shown, exported = learned(made[0] / PAGE), learned(tmp_path / "own.html")
    assert {part: set(shown[part]) for part in shown} == {part: set(exported[part]) for part in exported}


def test_a_file_in_place_of_the_folder_is_kept(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    ran = CliRunner().invoke(app, ["demo", "--out", str(tmp_path / "out"), "--no-browser"])
    assert isinstance(ran.exception, ValueError)
    assert (tmp_path / "out").read_text() == "mine"


def test_an_edited_scene_is_kept(tmp_path: Path) -> None:
    (tmp_path / SCENE).write_text("[punch]\nforce_N = 2\n")
    ran = CliRunner().invoke(app, ["demo", "--out", str(tmp_path), "--no-browser"])
    assert isinstance(ran.exception, InputFileError)
    assert "--out" in str(ran.exception)
    assert [path.name for path in tmp_path.iterdir()] == [SCENE]
    assert (tmp_path / SCENE).read_text() == "[punch]\nforce_N = 2\n"
