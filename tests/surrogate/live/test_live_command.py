"""`surrogate live`: choices that contradict each other, and a server that is not installed."""

import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

Command = Callable[..., CompletedProcess[str]]


@pytest.mark.parametrize(("words", "said"), [
    (("frames.csv",), "--replay"), (("-", "--replay", "a.csv"), "- and --replay"),
    (("--simulate", "card.json", "--export", "page.html"), "--simulate would have no effect"),
    (("--export", "page.html", "--baseline", "none.csv", "--noise-V", "-5", "--port", "80"),
     "--baseline and --noise-V and --port would have no effect"),
    (("--baseline", "none.csv"), "--baseline gives the untouched frames of a recording"),
    (("--data", "sweep"), "needs --simulate"), (("--replay", "none.csv"), "none.csv")], ids=str)
def test_choices_are_checked(command: Command, live_folder: Path, words: tuple[str, ...], said: str) -> None:
    pytest.importorskip("uvicorn")
    done = command("surrogate", "live", live_folder, *words)
    assert done.returncode == 2
    assert said in done.stderr


@pytest.mark.parametrize("missing", ["starlette", "uvicorn", "websockets"])
def test_what_is_missing_is_named_with_its_installation(command: Command, live_folder: Path, missing: str,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("starlette", "uvicorn", "websockets"):
        if name == missing:
            monkeypatch.setitem(sys.modules, name, None)
            break
        pytest.importorskip(name)
    done = command("surrogate", "live", live_folder)
    assert done.returncode == 2
    assert missing in done.stderr
    assert "pip install '.[live]'" in done.stderr


def test_a_port_that_is_taken_is_named(command: Command, address: str, live_folder: Path) -> None:
    port = address.split(":")[2].split("/")[0]
    done = command("surrogate", "live", live_folder, "--port", port)
    assert done.returncode == 2
    assert f"port {port} cannot be used" in done.stderr


@pytest.mark.thorough
def test_the_page_is_exported(command: Command, live_folder: Path, tmp_path: Path) -> None:
    done = command("surrogate", "live", live_folder, "--export", tmp_path / "page.html")
    assert done.returncode == 0
    assert "page.html" in done.stdout
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "src=" not in text
    assert "stylesheet" not in text
