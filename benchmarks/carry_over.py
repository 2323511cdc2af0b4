"""After a commit that changes no number: tables that were current at COMMIT get the hash of the code that is here, and
caches and sweeps of COMMIT go on (touchcal/same_numbers.json).

Usage: python benchmarks/carry_over.py COMMIT [BENCHMARK ...]. With benchmarks named only their tables are carried, and
caches and sweeps are not: where a commit changed some numbers and left those of these benchmarks. Renaming changes the
code hash, not results. Compare a row of each kind of sweep, a card and a prediction with those of COMMIT bit for bit
first; what was stale at COMMIT stays stale.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from touchcal.code_version import MECHANICS, ROOT, SAME_NUMBERS, SOLVERS, code_hash, script_hash

# What keys of caches and sweeps are made of, next to the benchmarks: solvers, mechanics, derivatives, measured sets.
KEYED = (SOLVERS, MECHANICS, ("eitsim.simulation.derivatives.readings",), ("eitsim.sweeps.run.measure",))
HASHES = f"""
import json, pathlib
from touchcal.code_version import code_hash, script_hash
found = {{p.stem: script_hash(p.resolve()) for p in pathlib.Path("benchmarks").glob("*.py")}}
print(json.dumps(found | {{" ".join(modules): code_hash(modules) for modules in {KEYED}}}))
"""


def hashes_at(commit: str) -> dict[str, str]:
    """Benchmark, or modules of KEYED, -> hash of its code at a commit, by that commit's own rule."""
    with tempfile.TemporaryDirectory() as folder:
        place = str(Path(folder) / "tree")
        subprocess.run(["git", "worktree", "add", "--detach", "--quiet", place, commit], cwd=ROOT, check=True)
        try:
            found = subprocess.run([sys.executable, "-c", HASHES], cwd=place, stdout=subprocess.PIPE, check=True)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", place], cwd=ROOT, check=True)
    return json.loads(found.stdout)


def main(commit: str, *named: str) -> None:
    """Rewrite the column `code` of tables whose rows were current, and SAME_NUMBERS."""
    there = hashes_at(commit)
    here = {old: script_hash(ROOT / "benchmarks" / f"{name}.py") for name, old in there.items()
            if (ROOT / "benchmarks" / f"{name}.py").is_file() and (not named or name in named)}
    if not named:
        SAME_NUMBERS.write_text("{}\n", encoding="utf-8")
        same = {code_hash(modules): there[" ".join(modules)] for modules in KEYED}
        SAME_NUMBERS.write_text(json.dumps(same, indent=1) + "\n", encoding="utf-8")
    for path in sorted((ROOT / "benchmarks" / "results").glob("*.csv")):
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        carried = [carry(line, here) for line in lines]
        if carried != lines:
            path.write_text("".join(carried), encoding="utf-8", newline="")
            print(f"{path.name}: {sum(a != b for a, b in zip(carried, lines, strict=True))} rows carried over")


def carry(line: str, here: dict[str, str]) -> str:
    """A line of a table, its code, which is the last column of every table, replaced where it is one of `here`."""
    text = line.rstrip("\r\n")
    before, comma, code = text.rpartition(",")
    return f"{before}{comma}{here[code]}{line[len(text):]}" if code in here else line


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(*sys.argv[1:])
