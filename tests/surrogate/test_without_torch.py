"""PyTorch is needed where networks of presses are trained or networks are exported, and nowhere else."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import surrogate
from surrogate.data.samples import SweepSamples
from surrogate.model import torchscript
from surrogate.recordings import press_reader

BLOCKED = """
import sys
class NoTorch:
    def find_spec(self, name, *_):
        if name.partition(".")[0] == "torch":
            raise ModuleNotFoundError("blocked")
sys.meta_path.insert(0, NoTorch())
import numpy as np
import surrogate
import surrogate.cli.main
import surrogate.live.serve
import surrogate.live.shows
frames = np.load(sys.argv[3])
for folder in sys.argv[1:3]:
    model = surrogate.load(folder)
    assert model.predict(frames[1:], frames[0])["x0_m"].notna().all()
    tracker = surrogate.Tracker(model, frames[0], 1e-6)
    assert tracker.update(frames[1]).state == "touch"
print(surrogate.evaluate(model, sys.argv[4]).scores["outputs"]["F"]["test"]["n"])
surrogate.train(sys.argv[4], "trainbr", "x0", epochs=1).save("trained")
"""


@pytest.mark.thorough
def test_models_are_read_scored_and_followed_without_torch(inner_model: surrogate.Model, sweep: Path,
                                                           samples: SweepSamples, tmp_path: Path) -> None:
    inner_model.save(tmp_path / "forward")
    surrogate.train(samples, "ridge", ("x0", "y0", "d", "F"), seed=1).save(tmp_path / "ridge")
    np.save(tmp_path / "frames.npy", np.vstack([samples.baseline_V[:1], samples.baseline_V[:3] + samples.signal_V[:3]]))
    done = subprocess.run([sys.executable, "-c", BLOCKED, "forward", "ridge", "frames.npy", str(sweep)], cwd=tmp_path,
                          capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    assert (tmp_path / "trained/model.json").is_file()


@pytest.mark.parametrize("needs", [
    lambda model, out: torchscript.write(model, out), lambda model, out: press_reader.fit(None, None)],
    ids=["export", "presses"])
def test_one_sentence_says_what_to_install(needs: Callable[..., object], samples: SweepSamples, tmp_path: Path,
                                           monkeypatch: pytest.MonkeyPatch) -> None:
    model = surrogate.train(samples, "trainbr", "x0", epochs=1)
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(ValueError, match=r"need PyTorch, which is not installed; run pip install '\.\[networks\]'"):
        needs(model, tmp_path / "net.pt")
