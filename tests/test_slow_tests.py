"""`.ci/run` runs every slow test but those named here, so that none fails unseen because nobody thought of it."""

import ast
import shlex
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
# Slow tests that `.ci/run` leaves out and `make test-slow` runs, by file, with their CPU minutes; None: not measured.
LEFT_OUT: dict[str, dict[str, float | None]] = {
    "tests/eitsim/mechanics/test_touch_errors.py": {
        "test_errors_of_random_profiles_are_covered": 9.2,
    },
    "tests/eitsim/sweeps/test_sweep_kills.py": {
        "test_thirty_random_kills_change_nothing": 2.8,
    },
    "tests/eitsim/sweeps/test_sweeps_on_curved_skins.py": {
        "test_touches_between_the_loads_of_a_table_are_those_solved_anew": 2.7,
    },
    "tests/matcal/fitting/test_interval_coverage.py": {
        "test_intervals_cover_the_truth_and_are_not_much_too_wide": None,
    },
    "tests/matcal/fitting/test_nu_left_open.py": {
        "test_intervals_with_a_fitted_nu_cover": None,
    },
    "tests/matcal/fitting/test_rubber_coverage.py": {
        "test_intervals_hold_the_truth": None,
    },
    "tests/matcal/readers/test_readers_fuzz.py": {
        "test_ten_thousand_broken_files": None,
    },
    "tests/matcal/reduction/test_contact.py": {
        "test_contact_error_over_many_replicas": 2.2,
    },
    "tests/surrogate/recordings/test_press_frames.py": {
        "test_scores_agree_with_presses_held_back": None,
    },
    "tests/surrogate/recordings/test_real_skins.py": {
        "test_a_hundred_presses_suffice": None,
        "test_intervals_hold_on_the_hydrogel_without_an_electrode": None,
        "test_the_hydrogel_is_read_through_drift": None,
        "test_twenty_suggested_presses_teach_as_much_as_thirty_random_ones": None,
    },
    "tests/surrogate/single_frame/test_one_frame.py": {
        "test_a_posterior_by_the_simulator_is_about_its_own_touch_and_not_the_map_s": None,
        "test_posteriors_hold_the_touches_of_noisy_frames_as_often_as_they_say": None,
    },
    "tests/test_documents.py": {
        "test_five_thousand_changed_documents_are_used_or_refused": None,
    },
    "tests/test_readme.py": {
        "test_readme_chain_runs": 2.6,
        "test_the_chain_in_python_runs": None,
    },
}


@cache
def slow_tests() -> set[str]:
    """file::function of every test that is slow, or has cases that are."""
    found = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        text = path.read_text(encoding="utf-8")
        if "mark.slow" in text:
            found |= {f"{path.relative_to(ROOT).as_posix()}::{part.name}" for part in ast.walk(ast.parse(text))
                      if isinstance(part, ast.FunctionDef) and "mark.slow" in "".join(map(
                          ast.unparse, part.decorator_list))}
    return found


def lists() -> list[tuple[list[str], list[str]]]:
    """Files or folders of each list of slow tests in `.ci/run`, and the parts of names that it takes; "" takes all."""
    text = (ROOT / ".ci" / "run").read_text(encoding="utf-8").replace("\\\n", " ")
    found = [shlex.split(line) for line in text.splitlines() if "pytest" in line and "-m slow" in line]
    return [([word for word in words if word.startswith("tests/")],
             words[words.index("-k") + 1].split(" or ") if "-k" in words else [""]) for words in found]


def taken(test: str, place: str, part: str) -> bool:
    """Whether a file or folder with a part of a name takes a test."""
    file, name = test.split("::")
    return (file == place or file.startswith(place + "/")) and (part in name or part in Path(file).name)


def test_every_slow_test_is_run_on_a_clean_checkout_or_named_with_its_minutes() -> None:
    run = {test for test in slow_tests() for places, parts in lists()
           if any(taken(test, place, part) for place in places for part in parts)}
    left_out = {f"{file}::{name}" for file, names in LEFT_OUT.items() for name in names}
    assert slow_tests() - run == left_out


def test_every_name_in_the_lists_is_that_of_a_slow_test() -> None:
    for places, parts in lists():
        for place in places:
            assert any(taken(test, place, part) for test in slow_tests() for part in parts), place
        for part in parts:
            assert any(taken(test, place, part) for test in slow_tests() for place in places), part
