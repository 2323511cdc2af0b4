import os
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("program", ["matcal", "eitsim", "surrogate"])
def test_an_interrupt_during_the_imports_leaves_no_traceback(program: str, tmp_path: Path) -> None:
    """Ctrl-C comes while the first library is imported."""
    (tmp_path / "typer.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    path = os.pathsep.join((str(tmp_path), str(ROOT)))
    done = subprocess.run([sys.executable, "-m", program, "--help"], env=os.environ | {"PYTHONPATH": path},
                          cwd=tmp_path, capture_output=True, text=True, timeout=60,
                          preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))  # ignored in the background
    assert done.returncode == -signal.SIGINT
    assert (done.stdout, done.stderr) == ("", "")
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert scripts[program] == f"{program}.__main__:main"
