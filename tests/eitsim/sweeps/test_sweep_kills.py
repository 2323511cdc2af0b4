"""Killed at random moments, a sweep loses and doubles nothing: continued, it equals one that was left alone."""

import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from eitsim.simulation import reuse
from eitsim.sweeps.dataset.parquet import COST, read_dataset, read_manifest
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run import sweep as sweeping
from eitsim.sweeps.run.folder import standing
from eitsim.sweeps.run.sweep import sweep
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

psutil = pytest.importorskip("psutil")

RAW = {"seed": 7, "punch": {"x_mm": [-35, 35], "y_mm": [-35, 35], "diameter_mm": 14, "force_N": [0.262, 0.298]},
       "accuracy": {"signal": 0.05}}
FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
DEPTHS, PART = (0.065, 0.07, 0.075), 4
SWEEP = f"""
import sys
from pathlib import Path
from eitsim.simulation import reuse
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run import sweep
if __name__ == "__main__":
    reuse.DEPTHS, sweep.ROWS_FROM_TABLE = {DEPTHS}, {PART}
    sweep.sweep(design_from({RAW}, int(sys.argv[3])), Path(sys.argv[1]), Path(sys.argv[2]), workers=2, reuse=True,
                progress=lambda step: print(step, flush=True))
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a card and a program that sweeps, whose table is in a cache of its own."""
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(reuse, "DEPTHS", DEPTHS)
    monkeypatch.setattr(sweeping, "ROWS_FROM_TABLE", PART)
    write_card(MaterialCard("Table 1", FOAM, None, Conductivity(30.0, [-2, 2, -1], (0, 0.4))), tmp_path / "card.json")
    (tmp_path / "program.py").write_text(SWEEP)
    return tmp_path


def left_alone(place: Path, scenes: int) -> pd.DataFrame:
    account = sweep(design_from(RAW, scenes), place / "card.json", place / "whole", reuse=True).account
    assert account is not None
    return rows(place / "whole")


def rows(folder: Path) -> pd.DataFrame:
    return read_dataset(folder).table.drop(columns=[*COST])


def started(place: Path, folder: Path, scenes: int) -> subprocess.Popen[str]:
    """The program in a group of its own."""
    return subprocess.Popen([sys.executable, str(place / "program.py"), str(place / "card.json"), str(folder),
                             str(scenes)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            start_new_session=True)


def workers(process: subprocess.Popen[str]) -> list[psutil.Process]:
    found = []
    for child in psutil.Process(process.pid).children():
        try:
            if any("spawn_main" in word for word in child.cmdline()):
                found.append(child)
        except psutil.NoSuchProcess:
            continue
    return found


def kill(process: subprocess.Popen[str], victim: str, chance: random.Random) -> bool:
    """Kill one worker, the parent or all of them; False where there was nobody. No worker outlives its parent."""
    hands = workers(process) if process.poll() is None else []
    if process.poll() is not None or (victim == "worker" and not hands):
        return False
    if victim == "worker":
        chance.choice(hands).kill()
        return True
    (os.killpg if victim == "group" else os.kill)(process.pid, signal.SIGKILL)
    process.wait()
    gone, alive = psutil.wait_procs(hands, timeout=30)
    assert not alive
    assert len(gone) == len(hands)
    return True


def finished(process: subprocess.Popen[str]) -> bool:
    """Whether the program came to its end; a kill of ours is the only other way out."""
    _, wrong = process.communicate(timeout=300)
    assert process.returncode in (0, -signal.SIGKILL), wrong
    return process.returncode == 0


def compared(folder: Path, whole: pd.DataFrame) -> None:
    pd.testing.assert_frame_equal(rows(folder), whole, check_exact=True)
    assert sorted(p.name for p in folder.iterdir()) == sorted(p.name for p in (folder.parent / "whole").iterdir())


def survived(place: Path, scenes: int, victims: list[str], wait_s: tuple[float, float], seed: int) -> None:
    """Sweep into one folder after the other until all victims are killed, and compare every one."""
    whole, chance, number = left_alone(place, scenes), random.Random(seed), 0
    while victims:
        folder = place / f"killed{number}"
        number += 1
        done = False
        while not done:
            process = started(place, folder, scenes)
            while victims and process.poll() is None:
                time.sleep(chance.uniform(*wait_s))
                if kill(process, victims[-1], chance):
                    victims.pop()
            done = finished(process)
        compared(folder, whole)


@pytest.mark.slow
def test_a_few_kills_change_nothing(place: Path) -> None:
    survived(place, 40, ["group", "parent", "worker"], (1.5, 3.0), seed=1)


def hears_interrupts(process: psutil.Process) -> bool:
    blocked = re.search(r"SigBlk:\s*(\w+)", Path(f"/proc/{process.pid}/status").read_text())
    assert blocked
    return not int(blocked[1], 16) & 1 << signal.SIGINT - 1


def heed_interrupts() -> None:
    """As from a terminal, also where the tests themselves run in the background of a shell."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_sweep_stops_cleanly_when_asked(place: Path, number: signal.Signals, status: int) -> None:
    (place / "design.toml").write_text("scenes = 100000\n[punch]\nx_mm = 99.0\ny_mm = [0.0, 1.0]\n")
    process = subprocess.Popen([sys.executable, "-m", "eitsim", "sweep", "design.toml", "--card", "card.json", "--out",
                                "set", "--workers", "2", "--no-reuse"], cwd=place, stderr=subprocess.PIPE, text=True,
                               start_new_session=True, preexec_fn=heed_interrupts)
    while len(list((place / "set").glob("*.parquet"))) < 3:
        assert process.poll() is None
        time.sleep(0.1)
    hands = workers(process)
    heard = any(hears_interrupts(hand) for hand in hands)
    os.killpg(process.pid, number)
    _, told = process.communicate(timeout=60)
    assert not heard
    assert process.returncode == status
    assert re.fullmatch(r"eitsim: 128 of the first 128 scenes will be refused.*\n"
                        rf"eitsim: stopped by {number.name}; \d+ of 100000 scenes are in set. The same command goes on "
                        r"from there.\n", told)
    assert not psutil.wait_procs(hands, timeout=30)[1]
    assert not list((place / "set").glob("*.tmp"))
    counts = standing(place / "set", 100_000, read_manifest(place / "set")).counts
    assert counts.rows == counts.outcomes["refused"] >= 3 * sweeping.ROWS_AFRESH


@pytest.mark.slow
def test_thirty_random_kills_change_nothing(place: Path) -> None:
    chance = random.Random(2)
    survived(place, 400, chance.choices(["worker", "parent", "group"], [2, 1, 1], k=32), (0.5, 6.0), seed=3)
