"""The README's own commands run as they stand, with smaller sweeps and a shorter chain, and the demo runs the same
ones."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from matcal import chains

ROOT = Path(__file__).parents[1]
# Scenes of the sweeps, and of those here.
FEWER = {"200": "20", "24": "8"}


def commands(text: str) -> list[list[str]]:
    """Commands of a shell text, continuation lines joined."""
    joined = text.replace("\\\n", " ")
    return [shlex.split(line) for line in joined.splitlines() if line.strip()]


def readme_commands() -> list[list[str]]:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```sh\n(.*?)```", readme, flags=re.DOTALL)
    return commands(block)


def skeleton(command: list[str]) -> list[str]:
    """A command without the folders and numbers that the demo sets itself."""
    return [Path(word).name for word in command if (not word.isdigit() and "$" not in word) or "/" in word]


@pytest.fixture
def short_chains(monkeypatch: pytest.MonkeyPatch) -> None:
    """A posterior that is sampled on, not to the end; tests/matcal/test_posterior.py samples to the end."""
    for name, value in {"CHUNK": 200, "RHAT": 2.0, "ESS": 10.0, "TIMES": 1.0}.items():
        monkeypatch.setattr(chains, name, value)


@pytest.mark.usefixtures("short_chains")
def test_readme_chain_runs(command: Callable[..., CompletedProcess[str]], tmp_path: Path) -> None:
    for name in ("data_raw", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    for words in readme_commands():
        small = [FEWER.get(word, word) for word in words]
        done = command(*small, cwd=tmp_path)
        assert done.returncode == 0, f"{shlex.join(small)}: {done.stderr}"
    for name in ("calibration.pdf", "touch.pdf", "sweep.pdf", "forward.pdf", "trainbr.pdf"):
        assert (tmp_path / name).read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize("command", readme_commands(), ids=lambda c: " ".join(c[:2]))
def test_demo_runs_the_same_commands(command: list[str]) -> None:
    if command[:2] == ["eitsim", "plan"]:
        return  # prints what `eitsim run` prints too
    demo = (ROOT / "examples" / "demo.sh").read_text(encoding="utf-8")
    assert skeleton(command) in [skeleton(step[2:]) for step in commands(demo) if step[0] == "step"]
