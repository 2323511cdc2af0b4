"""The house: packages in order, rooms in order, no circle, few floors, few files a folder, no name twice."""

from __future__ import annotations

import ast
import functools
import graphlib
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import pytest

import eitsim
import matcal
from eitsim.scene.scene import scene_from

ROOT = Path(__file__).parents[1]
# Packages from the ground up, each with its rooms from the ground up; a room imports only from rooms named before it.
HOUSE = {
    "touchcal": ("", "parallel"),
    "matcal": ("statistics", "laws", "card", "readers", "reduction", "fitting", "posterior", "record", "", "cli"),
    "eitsim": ("numerics", "scene", "sheet", "mechanics", "electrics", "simulation", "sensors", "sweeps", "presses", "",
               "cli"),
    "surrogate": ("statistics", "data", "recordings", "forward_map", "bounds", "learners", "model", "single_frame",
                  "live", "", "cli"),
    "reports": ("document", "calibration", "touch", "sensor", "sweep", "surrogate", ""),
}
MOST_ROOMS, MOST_FLOORS, MOST_FILES = 10, 6, 20
# How code would ask for a kind of electrodes by its name, in place of where these lie.
ELECTRODE_KIND = re.compile(r"""\.kind (?:==|!=|in) .*["'](?:line|patch|surface)["']""")
# Where texts that others wrote are read: vendors' files, messages of libraries.
OTHERS_TEXTS = ("benchmarks", "matcal/readers", "matcal/reduction/loading_direction.py", "touchcal/document.py")
# Methods by which a text is searched, taken apart or compared.
SEARCHES = {"startswith", "endswith", "removeprefix", "removesuffix", "find", "index", "count", "split", "rsplit",
            "partition", "rpartition", "contains", "match", "fullmatch", "search", "findall", "finditer"}
# Nodes of a module that are looked at.
READ = (ast.Import, ast.ImportFrom, ast.Raise, ast.Compare, ast.Call, ast.match_case)
DRAWING = {"matplotlib", "typst", "corner", "pyvista"}


def modules() -> list[Path]:
    return [path for package in HOUSE for path in sorted((ROOT / package).rglob("*.py"))]


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room_of(module: str) -> tuple[str, str]:
    package, *rest = module.split(".")
    if rest == ["__main__"] and package != "reports":
        return package, "cli"
    return package, rest[0] if len(rest) > 1 or (rest and rest[0] in HOUSE[package]) else ""


class Source(NamedTuple):
    """What a module imports, what it raises, as written, names of its sentences, and what it compares or searches."""

    imports: list[ast.Import | ast.ImportFrom]
    raised: list[str]
    sentences: set[str]
    comparisons: list[tuple[int, bool, set[str]]]


@functools.cache
def source(path: Path) -> Source:
    """A module, read and walked once."""
    text = path.read_text(encoding="utf-8")
    tree, lines = ast.parse(text), text.splitlines()
    nodes = [node for node in ast.walk(tree) if isinstance(node, READ)]
    return Source([node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)],
                  ["\n".join(lines[node.lineno - 1:node.end_lineno]) for node in nodes if isinstance(node, ast.Raise)],
                  sentences_of(tree), comparisons(nodes))


@functools.cache
def imports() -> dict[str, set[str]]:
    """Module -> modules of these packages that it imports, inside functions too; relative imports are refused."""
    names = {name_of(path) for path in modules()}
    found: dict[str, set[str]] = {}
    for path in modules():
        own: set[str] = set()
        for node in source(path).imports:
            if isinstance(node, ast.Import):
                own |= {alias.name for alias in node.names}
            else:
                assert node.level == 0, f"{path}: a relative import"
                own |= {full if (full := f"{node.module}.{alias.name}") in names else str(node.module)
                        for alias in node.names}
        found[name_of(path)] = own & names - {name_of(path)}
    return found


def outside(path: Path) -> set[str]:
    """Top-level names of everything that a module imports."""
    found: set[str] = set()
    for node in source(path).imports:
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        else:
            found.add((node.module or "").split(".")[0])
    return found


def test_imports_go_downstairs() -> None:
    packages, wrong = list(HOUSE), []
    for module, found in imports().items():
        package, room = room_of(module)
        for other in found:
            other_package, other_room = room_of(other)
            if package == other_package:
                down = HOUSE[package].index(other_room) <= HOUSE[package].index(room)
            else:
                down = packages.index(other_package) < packages.index(package) or (
                    room == "cli" and other_package == "reports")
            wrong += [] if down else [f"{module} -> {other}"]
    assert not wrong


def arrows_between_rooms() -> dict[str, set[tuple[str, str]]]:
    """Package -> (room, room that it imports), files at the top of a package left out."""
    rooms = [(room_of(module), room_of(other)) for module, found in imports().items() for other in found]
    return {package: {(one[1], other[1]) for one, other in rooms if one[0] == other[0] == package and one != other
                      and "" not in (one[1], other[1])} for package in HOUSE}


def test_the_import_graph_is_drawn_as_it_is() -> None:
    text = (ROOT / "docs" / "rooms.md").read_text(encoding="utf-8")
    drawn = set(re.findall(r"\w+\[(\w+)/(\w+)\] --> \w+\[\w+/(\w+)\]", text))
    assert drawn == {(package, *arrow) for package, arrows in arrows_between_rooms().items() for arrow in arrows}


def asks_of_the_edge() -> Counter[str]:
    """Room -> places that ask whether a body is a disc, but where this is defined."""
    found: Counter[str] = Counter()
    for path in modules():
        if not path.is_relative_to(ROOT / "eitsim" / "scene" / "edges") and path.name != "scene.py":
            asked = re.findall(r"\b(?:has_outline|is_round)\b|isinstance\([^()]*, (?:Disc|Outline)\)",
                               path.read_text(encoding="utf-8"))
            found["/".join(path.relative_to(ROOT).parts[:2])] += len(asked)
    return +found


def test_few_places_ask_whether_a_body_is_a_disc() -> None:
    """What edges have in common they answer themselves; the numbers may only fall."""
    most = {"eitsim/electrics": 2, "eitsim/mechanics": 3, "eitsim/sensors": 5, "eitsim/sweeps": 1,
            "eitsim/simulation": 11, "surrogate/bounds": 1, "surrogate/data": 1, "surrogate/cli": 1}
    assert {room: count for room, count in asks_of_the_edge().items() if count > most.get(room, 0)} == {}


def test_where_electrodes_lie_on_the_surface_is_asked_in_one_file() -> None:
    """Others ask for their loops, so that a new place is stated next to those in `outline_electrodes`."""
    asks = {path.name for path in modules()
            if re.search(r"\.anywhere\b|Place\.SURFACE", path.read_text(encoding="utf-8"))}
    assert asks == {"electrodes.py", "outline_electrodes.py"}


def climbs(work: Callable[[], object]) -> set[tuple[str, str, str]]:
    """Calls from a module of eitsim to one that stands above it, of those that it does not import: (module, function,
    what it calls), each once."""
    modules_of = {str(path): name_of(path) for path in modules() if path.is_relative_to(ROOT / "eitsim")}
    floor: dict[str, int] = {}
    for module in graphlib.TopologicalSorter({one: imports()[one] for one in modules_of.values()}).static_order():
        floor[module] = 1 + max((floor[other] for other in imports()[module] if other in floor), default=0)
    found: set[tuple[str, str, str]] = set()

    def seen(frame: FrameType, event: str, _: object) -> None:
        called = modules_of.get(frame.f_code.co_filename) if event == "call" else None
        caller = frame.f_back
        while called and caller is not None and caller.f_code.co_filename not in modules_of:
            caller = caller.f_back
        if called and caller is not None:
            module = modules_of[caller.f_code.co_filename]
            if floor[called] > floor[module]:
                found.add((module, caller.f_code.co_qualname, f"{called}.{frame.f_code.co_qualname}"))

    sys.setprofile(seen)
    try:
        work()
    finally:
        sys.setprofile(None)
    return found


@pytest.mark.parametrize(("scene", "most"), [({}, 8), ({"punch": {"conductor": True}}, 8), (
    {"punch": {"x_mm": 84, "force_N": 0.2}, "electrodes": {"soft": True}}, 20)], ids=str)
def test_a_scene_is_solved_downstairs(scene: dict[str, Any], most: int) -> None:
    """What is passed down is data: only a solver of numerics asks what it solves, above it, for energies and systems.
    """
    card = matcal.MaterialCard("foam", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                               conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
    plain, given = (scene_from(one | {"accuracy": {"signal": 0.05}}) for one in ({}, scene))
    if given == plain:
        eitsim.simulate(plain, card)  # imports and compiles what most others need
    found = climbs(lambda: eitsim.simulate(given, card))
    print(*sorted(found), sep="\n")
    assert {module.split(".")[1] for module, *_ in found} == {"numerics"}
    assert len(found) <= most


def test_no_circle_and_few_floors() -> None:
    """Floors of a folder: its files and folders, one above another as the imports among them go."""
    floors: dict[str, int] = {}
    for folder in {Path(*path.relative_to(ROOT).parts[:-1]) for path in modules()}:
        inside = [module for module in imports() if Path(*module.split(".")).is_relative_to(folder)
                  and not module.endswith("__main__")]
        depth = len(folder.parts)
        part = {module: ".".join(module.split(".")[:depth + 1]) for module in inside}
        arrows = {one: {part[other] for module in inside if part[module] == one for other in imports()[module]
                        if other in part and part[other] != one} for one in set(part.values())}
        floors[str(folder)] = max(height(one, arrows, ()) for one in arrows)
    assert {folder: count for folder, count in floors.items() if count > MOST_FLOORS} == {}


def height(one: str, arrows: dict[str, set[str]], path: tuple[str, ...]) -> int:
    assert one not in path, f"a circle: {' -> '.join([*path, one])}"
    return 1 + max((height(other, arrows, (*path, one)) for other in arrows[one]), default=0)


def test_folders_are_small() -> None:
    files = Counter(path.parent for path in modules() if not path.stem.startswith("__"))
    assert {str(folder): count for folder, count in files.items() if count > MOST_FILES} == {}
    for package in HOUSE:
        assert sum(1 for p in (ROOT / package).iterdir() if p.is_dir() and p.name[0] not in "_.") <= MOST_ROOMS


def test_no_module_name_twice_in_a_package() -> None:
    names = Counter((name_of(path).split(".")[0], path.stem) for path in modules() if not path.stem.startswith("__"))
    assert [name for name, count in names.items() if count > 1] == []


def test_electrodes_are_asked_where_they_lie() -> None:
    assert [path for path in modules() if ELECTRODE_KIND.search(path.read_text(encoding="utf-8"))] == []


def test_only_reports_draw() -> None:
    below = [path for path in modules() if path.relative_to(ROOT).parts[0] != "reports"]
    assert [path for path in below if outside(path) & DRAWING] == []


@pytest.mark.parametrize(("work", "may"), [
    ("import matcal.card", set()),
    ("import matcal; matcal.inspect('data_raw/mts_uniaxial.txt')", set()),
    ("import matcal; matcal.fit(['data_raw/uniaxial.csv', 'data_raw/shear.csv'])", {"scipy"})], ids=str)
def test_a_command_imports_what_it_needs(work: str, may: set[str]) -> None:
    """Imports are most of the time of a short command: half a second for each of the heavy packages."""
    loaded = subprocess.run([sys.executable, "-c", f"{work}; import sys; print(*sys.modules)"], capture_output=True,
                            text=True, check=True, cwd=ROOT).stdout
    heavy = {"emcee", "torch", "skfem", "matplotlib", "scipy", "pandas", "numba", "arviz", "lmfit", "pint", "typer"}
    assert heavy & set(loaded.split()) <= may


@pytest.mark.parametrize(("names", "room", "asks"), [
    ({"clusters", "unresolvable"}, "", {"eitsim.simulation.choose"}),
    ({"effect_of_edges", "other_edges_effect", "outer_edge_effect", "added_edges_cost", "near_rim_from",
      "near_edges_from"}, "", {"eitsim.simulation.routes"}),
    ({"solve_touch", "solve_near_rim", "solved_together", "solve_hold"}, "mechanics", {"eitsim.simulation.routes"})])
def test_how_a_touch_is_solved_is_decided_in_one_place(names: set[str], room: str, asks: set[str]) -> None:
    """Who asks, above the room that answers, whether edges and neighbours count, and who solves."""
    paths = [path for path in (ROOT / "eitsim").rglob("*.py") if room_of(name_of(path)) != ("eitsim", room)]
    found = {name_of(path) for path in paths for node in source(path).imports
             if isinstance(node, ast.ImportFrom) for alias in node.names if alias.name in names}
    assert {re.sub(r"(routes)\..*", r"\1", name) for name in found} == asks


def is_sentence(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str | bytes) and len(node.value.split()) > 1


def sentences_of(tree: ast.Module) -> set[str]:
    """Names at the top of a module that hold a sentence, or several."""
    named: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            held = [node.value, *(node.value.elts if isinstance(node.value, ast.Tuple | ast.List | ast.Set) else [])]
            named |= {target.id for target in targets if isinstance(target, ast.Name) and any(map(is_sentence, held))}
    return named


def operands(node: ast.AST) -> list[ast.AST]:
    """What a comparison takes: the parts of a sequence, of a pattern and of a choice, else the node itself."""
    if isinstance(node, ast.Tuple | ast.List | ast.Set | ast.IfExp | ast.BinOp | ast.JoinedStr | ast.pattern):
        return [part for child in ast.iter_child_nodes(node) for part in operands(child)]
    return [node]


def comparisons(nodes: list[ast.AST]) -> list[tuple[int, bool, set[str]]]:
    """Lines where code compares or searches, whether with a sentence, and the names with which."""
    found: list[tuple[int, bool, set[str]]] = []
    for node in nodes:
        parts: list[ast.AST] = []
        if isinstance(node, ast.Compare):
            parts = [node.left, *node.comparators]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in SEARCHES:
            parts = [*node.args]
        elif isinstance(node, ast.match_case):
            parts = [node.pattern]
        inner = [part for one in parts for part in operands(one)]
        names = {part.id if isinstance(part, ast.Name) else part.attr for part in inner
                 if isinstance(part, ast.Name | ast.Attribute)}
        if inner:
            found.append((getattr(node, "lineno", 0), any(map(is_sentence, inner)), names))
    return found


def compared(found: list[tuple[int, bool, set[str]]], known: set[str]) -> list[int]:
    """Lines of those where a sentence is compared or searched, by its text or by a name that holds one."""
    return [line for line, sentence, names in found if sentence or names & known]


def test_code_compares_kinds_and_no_sentences() -> None:
    """What is decided, or wrong, is a kind; its words are for people alone."""
    paths = [path for path in modules() if not path.relative_to(ROOT).as_posix().startswith(OTHERS_TEXTS)]
    own = {name_of(path): source(path).sentences for path in paths}
    wrong = []
    for path in paths:
        froms = [(node.module, alias) for node in source(path).imports if isinstance(node, ast.ImportFrom)
                 for alias in node.names]
        known = own[name_of(path)] | {alias.asname or alias.name for module, alias in froms
                                      if alias.name in own.get(module or "", set())}
        known |= {name for module, alias in froms for name in own.get(f"{module}.{alias.name}", set())}
        wrong += [f"{path.relative_to(ROOT)}:{line}" for line in compared(source(path).comparisons, known)]
    assert wrong == []


@pytest.mark.parametrize("code", ["a == 'two words'", "'two words' in a", "a.startswith('two words')",
                                  "SAID = 'two words'\na != SAID", "SAID = ('one', 'two words')\na in SAID",
                                  "match a:\n    case 'two words':\n        pass"])
def test_a_comparison_of_a_sentence_is_found(code: str) -> None:
    tree = ast.parse(code)
    assert compared(comparisons(list(ast.walk(tree))), sentences_of(tree))


def test_no_module_is_named_after_nothing() -> None:
    assert not [p for p in modules() if p.stem in {"utils", "util", "helpers", "helper", "common", "misc", "manager"}]


def test_library_errors_name_arguments_not_options() -> None:
    """A command puts its options in their place; commands in backticks are whole."""
    wrong = []
    for path in modules():
        if path.relative_to(ROOT).parts[0] in ("matcal", "surrogate", "reports") and room_of(name_of(path))[1] not in (
                "cli", ""):
            wrong += [f"{path.name}: {one}" for one in source(path).raised
                      if re.search(r"--[a-z]", re.sub(r"`[^`]*`", "", one))]
    assert not wrong


def test_tests_mirror_the_packages() -> None:
    rooms = {path.relative_to(ROOT / "tests").parts[:2] for path in (ROOT / "tests").glob("*/*/*.py")}
    made_of_a_checkout = {("reports", "benchmarks"), ("reports", "paper")}
    assert rooms <= {(package, room) for package, there in HOUSE.items() for room in there} | made_of_a_checkout
