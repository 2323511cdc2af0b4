"""The README's own commands run as they stand, on a smaller sweep (slow), and the demo, which `.ci/run` runs, has the
same ones; the chain in Python runs as it stands, and the first page's two examples print what it says."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCENES = "30"


def readme_block(kind: str) -> str:
    """The first block of a kind, as it stands."""
    found = re.search(rf"```{kind}\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.DOTALL)
    assert found is not None
    return found[1]


def commands(text: str) -> list[list[str]]:
    """Commands of a shell text, continuation lines joined."""
    joined = text.replace("\\\n", " ")
    return [shlex.split(line) for line in joined.splitlines() if line.strip()]


def readme_commands() -> list[list[str]]:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```sh\n(.*?)```", readme, flags=re.DOTALL)
    return commands(block)


def test_the_first_page_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


def skeleton(command: list[str]) -> list[str]:
    """A command without the folders and numbers that the demo sets itself."""
    return [Path(word).name for word in command if (not word.isdigit() and "$" not in word) or "/" in word]


@pytest.mark.slow
def test_readme_chain_runs(tmp_path: Path) -> None:
    for name in ("data_raw", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    for command in readme_commands():
        small = [SCENES if word == "200" else word for word in command]
        done = subprocess.run(small, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, f"{shlex.join(small)}: {done.stderr}"
    for name in ("calibration.pdf", "touch.pdf", "sweep.pdf", "forward.pdf", "trainbr.pdf"):
        assert (tmp_path / name).read_bytes().startswith(b"%PDF")


@pytest.mark.slow  # `.ci/run` runs it from a wheel, outside the checkout, alone
def test_the_chain_in_python_runs(tmp_path: Path) -> None:
    for name in ("data_raw", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    done = subprocess.run([sys.executable, "examples/chain.py"], cwd=tmp_path, capture_output=True, text=True,
                          timeout=500)
    assert done.returncode == 0, done.stderr
    assert "F_lo90_N" in done.stdout


@pytest.mark.parametrize("command", readme_commands(), ids=lambda c: " ".join(c[:2]))
def test_demo_runs_the_same_commands(command: list[str]) -> None:
    if command[:2] == ["eitsim", "plan"]:
        return  # prints what `eitsim run` prints too
    demo = (ROOT / "examples" / "demo.sh").read_text(encoding="utf-8")
    assert skeleton(command) in [skeleton(step[2:]) for step in commands(demo) if step[0] == "step"]


@pytest.mark.parametrize("tests", [
    ["data_raw/uniaxial.csv"], ["data_raw/shear.csv"], ["data_raw/mts_uniaxial.txt"], ["data_raw/mts_shear.txt"],
    ["data_raw/mts_relaxation.txt"], ["conductivity=data_raw/mts_stretch.txt,data_raw/nova_stretch.txt"],
    ["conductivity=data_raw/mts_cyclic.txt,data_raw/nova_cyclic.txt"]], ids=lambda tests: tests[0])
def test_the_files_of_every_page_give_nothing_to_mind(tests: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The first commands of README, help, tutorials and gallery fit these: of the records nothing is to be minded."""
    import matcal

    monkeypatch.chdir(ROOT)
    assert matcal.read_test(tests[0], "data_raw/specimen.toml").cautions == ()


def test_the_first_page_prints_what_it_says(command: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path,
                                            monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
                                            ) -> None:
    (tmp_path / "disc_uniaxial.csv").write_text(readme_block("csv"))
    done = command("matcal", "fit", "disc_uniaxial.csv", "--out", "foam.json", cwd=tmp_path)
    printed = [line.rstrip() for line in done.stdout.splitlines()]
    assert [line for line in readme_block("text").splitlines() if line not in printed] == []
    # one mode, one specimen, one rate: what is true of seven rows of one test, and nothing else
    minded = [" ".join(line.split()[1:4]) for line in printed if line.startswith("  !")]
    assert minded == ["Only uniaxial loading", "One specimen of", "Moduli count as"]
    monkeypatch.chdir(tmp_path)
    exec(readme_block("python"), {})
    depth_m, *shape, error = re.findall(r"[\d.]+", capsys.readouterr().out)
    assert (round(1e3 * float(depth_m), 2), shape, round(float(error), 3)) == (1.91, ["16", "13"], 0.006)
