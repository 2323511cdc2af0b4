"""What every command line shares."""

import re
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import pytest
from rich.console import Console

from touchcal.terminal import application, counted, run, waiting


def test_ctrl_c_is_answered_in_a_sentence(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    app = application("Waits.")

    @app.command()
    def wait() -> None:
        """Wait."""
        raise KeyboardInterrupt

    monkeypatch.setattr(sys, "argv", ["waiter", "wait"])
    with pytest.raises(SystemExit, match=r"^130$"):
        run(app, "waiter")
    assert capsys.readouterr().err == "waiter: stopped by Ctrl-C; files are written whole or not at all.\n"


@pytest.mark.parametrize("words", [("matcal", "fit", "a.csv"), ("surrogate", "train", "sweep", "--out", "model"),
                                   ("surrogate", "predict", "model", "frames.csv")])
@pytest.mark.parametrize(("seed", "expected"), [("-1", r"\b0\b"), (str(2**63), str(2**63 - 1)), ("x", "integer")])
def test_a_seed_that_is_none_is_refused_by_its_option(words: tuple[str, ...], seed: str, expected: str,
                                                      command: Callable[..., Any]) -> None:
    done = command(*words, f"--seed={seed}")
    assert done.returncode == 2
    assert "'--seed'" in done.stderr
    assert re.search(expected, done.stderr)


def _in_shell(words: str) -> subprocess.CompletedProcess[str]:
    program = f'"{sys.executable}" -c "from matcal.__main__ import main; main()"'
    return subprocess.run(["bash", "-c", words.replace("PROGRAM", program)], capture_output=True, text=True,
                          check=False)


def test_a_reader_that_leaves_a_pipe_ends_the_program_without_a_word() -> None:
    done = _in_shell("PROGRAM inspect data_raw/*.txt data_raw/*.csv | true; echo ${PIPESTATUS[0]}")
    assert (done.stdout, done.stderr) == ("141\n", "")


def test_a_program_says_its_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        application("Help.")(args=["--version"], prog_name="program")
    assert end.value.code == 0
    assert capsys.readouterr().out == f"touchcal {version('touchcal')}\n"


def _waited() -> None:
    with waiting("learning"):
        assert list(counted("networks")(range(3))) == [0, 1, 2]


def test_what_takes_long_is_said_on_a_terminal_alone(monkeypatch: pytest.MonkeyPatch,
                                                     capsys: pytest.CaptureFixture[str]) -> None:
    _waited()
    assert capsys.readouterr() == ("", "")
    terminal = Console(stderr=True, force_terminal=True, _environ={"TERM": "xterm", "COLUMNS": "100"})
    monkeypatch.setattr("touchcal.terminal._terminal", lambda: terminal)
    _waited()
    out, err = capsys.readouterr()
    assert out == ""
    assert re.search("learning.*networks.*0/3", err, re.DOTALL)


@pytest.mark.parametrize(("how", "status", "words"), [
    (">&-", 2, "matcal: standard output is closed. Open it, or send it to a file or /dev/null.\n"),
    ("| true; exit ${PIPESTATUS[0]}", 141, ""), ("| head -n 1 >/dev/null; exit ${PIPESTATUS[0]}", 141, "")])
def test_a_closed_output_and_a_reader_that_left_end_a_command_without_a_traceback(how: str, status: int,
                                                                                   words: str) -> None:
    lines = "print('x\\n' * 200_000)"
    program = ("import time; from touchcal.terminal import application, run; app = application('Help.'); "
               f"app.command('lines')(lambda: (time.sleep(0.3), {lines})); run(app, 'matcal')")
    done = subprocess.run(["bash", "-c", f'"$0" -c "$1" lines {how}', sys.executable, program],
                          capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (status, words)


def test_errors_name_arguments_and_commands_their_options(capsys, monkeypatch) -> None:
    app = application("A program.")

    @app.command()
    def weigh(strain_zero: float = 0.0) -> None:
        raise ValueError("`strain_zero` 3, `weights` and `no_option`: leave `weigh --at` out.")

    monkeypatch.setattr(sys, "argv", ["scales", "weigh"])
    with pytest.raises(SystemExit):
        run(app, "scales", {"weights": "--weight"})
    assert "--strain-zero 3, --weight and `no_option`: leave `weigh --at` out." in capsys.readouterr().err
