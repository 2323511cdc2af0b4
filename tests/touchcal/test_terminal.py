"""What every command line shares."""

from __future__ import annotations

import sys

import pytest

from touchcal.terminal import application, run


def test_ctrl_c_is_answered_in_a_sentence(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    app = application("Waits.")

    @app.command()
    def wait() -> None:
        """Wait."""
        raise KeyboardInterrupt

    monkeypatch.setattr(sys, "argv", ["waiter"])
    with pytest.raises(SystemExit, match=r"^130$"):
        run(app, "waiter")
    assert capsys.readouterr().err == "waiter: stopped by Ctrl-C; files are written whole or not at all.\n"
