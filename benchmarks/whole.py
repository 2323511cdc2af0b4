"""Every benchmark in turn, each in a process of its own, and what each took; `make bench`, or `make bench QUICK=1`.

Those that read a card, a data set or a model get those of a short chain made first from data_raw (synthetic). A
benchmark that fails is told at the end and does not stop the others; those that need the paper's sweep
or a GPU are left out. Writes results/whole.csv, in quick mode results/quick/whole.csv; names of benchmarks as arguments
run those alone.

`python benchmarks/whole.py demo`: the steps of examples/demo.sh with an empty cache and nothing compiled, as after an
installation, in results/demo.csv; wall time and CPU time, s, of each and of compilation in the first touch. Wall times
need an idle machine; those of steps that run two at a time add up to more than all took.
"""

import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from conditions import quick, shown, written

HERE = Path(__file__).parent
RAW = HERE.parent / "data_raw"
# what each benchmark is given, of the short chain's files
GIVEN = {"frame_drift": ("sweep",), "inversion_limit": ("forward", "sweep", "card.json"),
         "live_page": ("forward", "card.json"), "sensor_design": ("card.json", "sweep"), "streaming": ("ridge",),
         "surrogate_noise": ("sweep",), "three_touches": ("forward", "sweep", "card.json"),
         "two_touches": ("forward", "sweep", "card.json"),
         "variants": ("card.json",)}
# what needs the paper's sweep of 4,000 scenes, files of others or a GPU, or measures nothing, and is run by hand
APART = ("carry_over", "contacts", "faithful", "foams", "gpu", "identify", "mutants", "next_test",
         "paced_stream", "ridge", "silent_answers", "simulated_prior", "surrogates", "tracker", "transfer", "treloar",
         "unchanged", "untouched_frame", "whole_disc")
CHAIN = (
    ("matcal", "fit", RAW / "uniaxial.csv", RAW / "shear.csv",
     f"conductivity={RAW / 'mts_stretch.txt'},{RAW / 'nova_stretch.txt'}", "--specimen", RAW / "specimen.toml",
     "--posterior", "--seed", "1", "--out", "card.json"),
    ("eitsim", "sweep", HERE.parent / "examples" / "design.toml", "--card", "card.json", "--scenes",
     quick("400", "80"), "--out", "sweep"),
    *(("surrogate", "train", "sweep", "--out", method, "--method", method, "--seed", "1")
      for method in ("ridge", "forward")))


def names() -> list[str]:
    """Benchmarks that can be run, this one apart."""
    runnable = (path.stem for path in sorted(HERE.glob("*.py"))
                if '__name__ == "__main__"' in path.read_text(encoding="utf-8"))
    return [name for name in runnable if name not in (Path(__file__).stem, *APART)]


def timed(name: str, command: Sequence[str | Path], folder: Path) -> dict[str, object]:
    """What a command took, and how it ended."""
    begun, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=folder, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {"benchmark": name, "outcome": "ok" if done.returncode == 0 else f"status {done.returncode}",
            "wall_s": time.perf_counter() - begun,
            "cpu_s": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime}


def runs(asked: Sequence[str], folder: Path) -> Iterator[dict[str, object]]:
    """One row a command."""
    if set(asked) & set(GIVEN):
        for command in CHAIN:
            yield timed(f"chain: {command[0]}", [sys.executable, "-m", *command], folder)
    for name in asked:
        print(f"== {name}", flush=True)
        given = [folder / one if (folder / one).exists() else one for one in GIVEN.get(name, ())]
        yield timed(name, [sys.executable, HERE / f"{name}.py", *given], folder)


def demo(folder: Path) -> Iterator[dict[str, object]]:
    """What each step of the demo took, with nothing at hand that it makes itself."""
    fresh = {"TOUCHCAL_CACHE": str(folder / "cache"), "NUMBA_CACHE_DIR": str(folder / "compiled")}
    done = subprocess.run(["bash", HERE.parent / "examples" / "demo.sh", folder / "out"], check=True, text=True,
                          stdout=subprocess.PIPE, env=os.environ | fresh)
    yield from steps_of(done.stdout)


def steps_of(printed: str) -> Iterator[dict[str, object]]:
    """The steps of a demo by what it printed, then compilation in the first touch, then all."""
    said = re.findall(r"^\$ (\S+ \S+)|^-> (.*) \((\S+) s, (\S+) s of CPU\)$", printed, re.MULTILINE)
    rows = [{"step": f"{command}: {Path(result.split(',')[0]).name}", "wall_s": float(wall), "cpu_s": float(cpu)}
            for (command, *_), (_, result, wall, cpu) in zip(said[::2], said[1::2], strict=True)]
    compiling = re.search(r"CPU of compiling, once, s +(\S+)", printed)
    rows.append({"step": "compilation in the first touch", "wall_s": None,
                 "cpu_s": float(compiling[1]) if compiling else None})
    whole = re.search(r"^demo: (\d+) s in all", printed, re.MULTILINE)
    assert whole is not None
    yield from [*rows, {"step": "all", "wall_s": float(whole[1]), "cpu_s": sum(row["cpu_s"] for row in rows[:-1])}]


def main() -> None:
    if sys.argv[1:] == ["demo"]:
        with tempfile.TemporaryDirectory() as place:
            shown(written(demo(Path(place)), "demo"))
        return
    print(f"left out, since they need the paper's sweep or a GPU: {', '.join(APART)}", flush=True)
    found = []
    if unknown := set(sys.argv[1:]) - set(names()):
        raise SystemExit(f"no benchmark {', '.join(sorted(unknown))}; known: {', '.join(names())}.")
    with tempfile.TemporaryDirectory() as place:
        for row in runs(sys.argv[1:] or names(), Path(place)):
            found.append(row)
            table = written(found, "whole")
    shown(table)
    if failed := [str(row["benchmark"]) for row in found if row["outcome"] != "ok"]:
        raise SystemExit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
