"""Hash of the code that decides numbers: the definitions that some modules need, wherever they stand.

Moving a definition, splitting or merging modules, comments, docstrings and layout leave the hash as it is. What counts
is every function, class and constant that is named, directly or not, from all of the modules asked for, together with
bare statements of the modules met on the way. A string `package.module:Name` names that definition; what a decorator or
another string alone makes known is not followed.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

# The packages, whose code counts; and modules next to a benchmark that describe runs and decide no number.
PACKAGES = ("touchcal", "matcal", "eitsim", "surrogate")
DESCRIBING = ("conditions",)
ROOT = Path(__file__).parents[1]  # Folder that holds the packages.
# What solves the rows of a sweep, and what solves tables of load paths. What describes rows is imported by neither.
SOLVERS = ("eitsim.sweeps.run.parts", "eitsim.sweeps.run.load_path_choice")
# Modules whose definitions, with what they need, make every touch and table of load paths; nothing of the skin.
MECHANICS = ("eitsim.simulation.build_rim_table", "eitsim.mechanics.load_paths.build_table",
             "eitsim.simulation.near_edges", "eitsim.mechanics.axisymmetric.solve_axisymmetric")
# Hashes of code that gives the numbers of an earlier one, whose hash goes on to count: this -> the earlier.
SAME_NUMBERS = Path(__file__).with_name("same_numbers.json")
DIGITS = 12  # Digits of the hash that a table of results carries.

_POINTER = re.compile(rf"({'|'.join(PACKAGES)})(\.\w+)*:\w+")  # A string that names a definition.

_Name = tuple[str, str]  # A definition: the module's name and its own, "" for the module's bare statements.


@functools.cache
def code_hash(modules: tuple[str, ...] = SOLVERS, root: Path = ROOT) -> str:
    """SHA-256 of the definitions of `modules` and of all that they need, as they are when this process first asks; that
    of an earlier code where SAME_NUMBERS says that its numbers are the same."""
    found = _digest(_code(root), modules)
    return json.loads(SAME_NUMBERS.read_text(encoding="utf-8")).get(found, found)


def script_hash(script: Path, root: Path = ROOT) -> str:
    """The first digits of the hash of a script, such as a benchmark, and of all that it needs of the packages and of
    modules next to it."""
    return _digest(_code(root, script.parent), (script.stem,))[:DIGITS]


def source_hash(root: Path = ROOT) -> str:
    """SHA-256 of every file that decides code_hash, names included, which is quicker to have."""
    found = hashlib.sha256(SAME_NUMBERS.read_bytes())
    for path in (path for package in PACKAGES for path in sorted((root / package).rglob("*.py"))):
        found.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


@functools.cache
def _code(root: Path, scripts: Path | None = None) -> _Code:
    return _Code(root, scripts)


def _digest(code: _Code, modules: Iterable[str]) -> str:
    texts = {text for one in _reached(code, modules) for text in code.definition(one).texts}
    return hashlib.sha256("\0".join(sorted(texts)).encode()).hexdigest()


def _reached(code: _Code, modules: Iterable[str]) -> set[_Name]:
    """Definitions of `modules` and what they name, directly or not."""
    ahead = [one for module in modules for one in code.whole(module)]
    found: set[_Name] = set()
    while ahead:
        one = ahead.pop()
        if one not in found:
            found.add(one)
            ahead += [(one[0], ""), *code.definition(one).needs]
    return found


@dataclass(frozen=True)
class _Definition:
    """What a name of a module stands for."""

    texts: tuple[str, ...]  # its statements without docstrings and imports, names imported as others by their own
    needs: frozenset[_Name]  # what they name


@dataclass(frozen=True)
class _Module:
    """What a module defines and imports."""

    # name -> the statements that define it; "" -> statements that define nothing
    defined: Mapping[str, Sequence[ast.stmt]]
    imported: Mapping[str, str]  # name -> the module or the member of a module, dotted, that it stands for


class _Code:
    """Modules of the packages below `root`, and of the folder of a script, each read once."""

    def __init__(self, root: Path, scripts: Path | None) -> None:
        self._root, self._scripts = root, scripts
        self._modules: dict[str, _Module | None] = {}
        self._definitions: dict[_Name, _Definition] = {}
        self._statements: dict[int, tuple[str, frozenset[_Name]]] = {}

    def whole(self, module: str) -> Iterator[_Name]:
        """All definitions of a module; none where it is none of these."""
        if (read := self._read(module)) is not None:
            yield from ((module, name) for name in ("", *read.defined))

    def definition(self, one: _Name) -> _Definition:
        """The texts and needs of a definition of a module that is there."""
        if one not in self._definitions:
            read = self._read(one[0])
            assert read is not None
            found = [self._statement(one[0], read, statement) for statement in read.defined.get(one[1], ())]
            self._definitions[one] = _Definition(tuple(text for text, _ in found if text),
                                                 frozenset().union(*(needs for _, needs in found)))
        return self._definitions[one]

    def _statement(self, module: str, read: _Module, statement: ast.stmt) -> tuple[str, frozenset[_Name]]:
        """Text and needs of a statement, which is changed on the way and so is worked out once."""
        if id(statement) not in self._statements:
            needs = frozenset(meant for chain in _chains(statement) for meant in self._named(module, read, chain))
            modules = {name for name, path in read.imported.items() if self._read(path) is not None}
            kept = _Plain(read.imported, modules).visit(statement)
            self._statements[id(statement)] = "" if kept is None else ast.unparse(kept), needs
        return self._statements[id(statement)]

    def _named(self, module: str, read: _Module, chain: Sequence[str], way: tuple[_Name, ...] = ()) -> Iterator[_Name]:
        """What a dotted name in a module stands for: a definition of its own, one imported, or a module whole; `way`
        are the imports that led here, for names that two modules import from each other inside functions."""
        if chain[0] in read.defined:
            yield module, chain[0]
        if chain[0] in read.imported and (module, chain[0]) not in way:
            yield from self._at([*read.imported[chain[0]].split("."), *chain[1:]], (*way, (module, chain[0])))
        elif chain[0] in PACKAGES:
            yield from self._at(chain, way)

    def _at(self, path: Sequence[str], way: tuple[_Name, ...]) -> Iterator[_Name]:
        """What a dotted path leads to: a member of the innermost module on it, or that module whole."""
        found = [k for k in range(1, len(path) + 1) if self._read(".".join(path[:k])) is not None]
        if not found:
            return
        module, rest = ".".join(path[:found[-1]]), path[found[-1]:]
        read = self._read(module)
        if read is not None and rest:
            yield from self._named(module, read, rest, way)
        else:
            yield from self.whole(module)

    def _read(self, name: str) -> _Module | None:
        """A module; None where it is none of these."""
        if name not in self._modules:
            path = self._file(name)
            self._modules[name] = None if path is None else _parsed(path.read_text(encoding="utf-8"))
        return self._modules[name]

    def _file(self, name: str) -> Path | None:
        first, *rest = name.split(".")
        if first in PACKAGES:
            place = self._root.joinpath(first, *rest)
            places = [place.with_name(f"{place.name}.py"), place / "__init__.py"]
        elif self._scripts is None or first in DESCRIBING or rest:
            return None
        else:
            places = [self._scripts / f"{first}.py"]
        return next((path for path in places if path.is_file()), None)


def _parsed(source: str) -> _Module:
    tree = ast.parse(source)
    defined: dict[str, list[ast.stmt]] = {}
    for statement in tree.body:
        for name in _names(statement):
            defined.setdefault(name, []).append(statement)
    return _Module(defined, dict(_imports(tree)))


def _names(statement: ast.stmt) -> Iterator[str]:
    """Names that a statement at the top of a module defines, "" for one that defines none; nothing for what does not
    count: imports, docstrings, and what is for checkers of types."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        yield statement.name
    elif isinstance(statement, ast.Assign | ast.AnnAssign | ast.AugAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        found = [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
        yield from found or [""]
    elif not (isinstance(statement, ast.Import | ast.ImportFrom) or _is_text(statement)
              or (isinstance(statement, ast.If) and ast.unparse(statement.test).endswith("TYPE_CHECKING"))):
        yield ""


def _imports(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Imported name -> what it stands for, imports inside functions too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.asname or alias.name.split(".")[0], alias.name if alias.asname else
                         alias.name.split(".")[0]) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from ((alias.asname or alias.name, f"{node.module}.{alias.name}") for alias in node.names)


def _chains(statement: ast.AST) -> Iterator[list[str]]:
    """Names and dotted names in a statement; of `a.b.c` that alone, not `a`."""
    ahead: list[ast.AST] = [statement]
    while ahead:
        node = ahead.pop()
        if (chain := _dotted(node)) is not None:
            yield chain
        else:
            ahead += ast.iter_child_nodes(node)


def _dotted(node: ast.AST) -> list[str] | None:
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and _POINTER.fullmatch(node.value):
        return node.value.replace(":", ".").split(".")
    if isinstance(node, ast.Name):
        return [node.id]
    if isinstance(node, ast.Attribute) and (before := _dotted(node.value)) is not None:
        return [*before, node.attr]
    return None


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant) and isinstance(
        statement.value.value, str)


class _Plain(ast.NodeTransformer):
    """Drops imports and texts that stand alone; `module.name` and `other as name` become the name itself."""

    def __init__(self, imported: Mapping[str, str], modules: Set[str]) -> None:
        self._imported, self._modules = imported, modules

    def visit_Import(self, _: ast.Import) -> None:
        """Where a name stands does not count."""

    def visit_ImportFrom(self, _: ast.ImportFrom) -> None:
        """As visit_Import."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        """Docstrings do not count."""
        return None if _is_text(node) else self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """A name that is imported from these packages as it is called where it is defined; a module by no name."""
        meant = self._imported.get(node.id, "")
        if meant.partition(".")[0] not in PACKAGES:
            return node
        return ast.Name("module" if node.id in self._modules else meant.rpartition(".")[2], node.ctx)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """A member of an imported module by its own name alone."""
        if isinstance(node.value, ast.Name) and node.value.id in self._modules:
            return ast.Name(node.attr, node.ctx)
        return self.generic_visit(node)

    def generic_visit(self, node: ast.AST) -> ast.AST:
        """Children first; a body that lost all its statements holds `pass`."""
        super().generic_visit(node)
        if not isinstance(node, ast.Module) and getattr(node, "body", None) == []:
            node.body = [ast.Pass()]  # pyright: ignore[reportAttributeAccessIssue]
        return node
