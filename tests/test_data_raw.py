"""The synthetic files are what the generator writes, and the generator stands apart from what it tests."""

import ast
import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parents[1] / "data_raw"


def _sums(folder: Path) -> dict[str, str]:
    lines = (folder / "SHA256SUMS").read_text().splitlines()
    return {name: digest for digest, name in (line.split("  ") for line in lines)}


def test_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    subprocess.run([sys.executable, str(FOLDER / "generate.py"), str(tmp_path)], check=True)
    assert _sums(tmp_path) == _sums(FOLDER)


def test_files_match_their_sums() -> None:
    for name, digest in _sums(FOLDER).items():
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == digest, name


def test_generator_imports_nothing_of_the_program() -> None:
    tree = ast.parse((FOLDER / "generate.py").read_text(encoding="utf-8"))
    names = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    names |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    roots = {name.split(".")[0] for name in names}
    assert roots <= {"numpy", "scipy", *sys.stdlib_module_names}


def test_truth_is_slightly_stiffer_than_table_1_at_low_strain_only() -> None:
    law = json.loads((FOLDER / "truth.json").read_text())["longterm"]
    mu, alpha = np.array(law["mu_kPa"]), np.array(law["alpha"])
    strain = np.array(law["uniaxial"]["strain"][1:])
    stress = np.array(law["uniaxial"]["stress_kPa"][1:])
    table_1 = [np.sum(2 * mu[:3] / alpha[:3] * ((1 + e) ** alpha[:3] - 1)) / (1 + e) for e in strain]
    excess = stress / table_1 - 1
    assert law["mu_0_kPa"] / law["table_1_mu_0_kPa"] - 1 == np.clip(law["mu_0_kPa"] / 9.53 - 1, 0.02, 0.03)
    assert 0.02 < excess[0] < 0.03
    assert 0 < excess[-1] < 0.01


def test_machine_tests_are_stiffer_than_the_long_term_curve_and_softer_than_the_instantaneous_one() -> None:
    truth = json.loads((FOLDER / "truth.json").read_text())
    test, law = truth["tests_at_5_mm_per_min_and_relaxation"]["uniaxial"], truth["longterm"]["uniaxial"]
    slow = np.interp(test["strain"][::-1], law["strain"][::-1], law["stress_kPa"][::-1])[::-1]
    ratio = np.array(test["stress_kPa"]) / slow
    assert np.all(ratio[3:] > 1.03)
    assert np.all(ratio < 1 / (1 - sum(truth["prony"]["g"])))
