"""Words that non-native readers stumble over are in no page, help or message; CONTRIBUTING.md has others for them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("touchcal", "matcal", "eitsim", "surrogate", "reports")
RETIRED = re.compile(r"\b(told|besides?|beyond|apart|afresh|alike|wanted|mend(s|ed)?)\b", re.IGNORECASE)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs").glob("[he]*/*.md")),
         *sorted((ROOT / "docs").glob("[tg]*/**/*.py")),
         *sorted(path for path in (ROOT / "examples").rglob("*") if path.suffix in (".py", ".sh", ".toml"))]


def test_pages_are_in_plain_words() -> None:
    found = {page.name: RETIRED.findall(page.read_text(encoding="utf-8")) for page in PAGES}
    assert {name: words for name, words in found.items() if words} == {}


def test_help_and_messages_are_in_plain_words() -> None:
    files = {path: path.read_text(encoding="utf-8") for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
    found = [f"{path.name}:{line}: {text}" for path, code in files.items() if RETIRED.search(code)
             for line, text in shown(ast.parse(code)) if RETIRED.search(text)]
    assert found == []


def shown(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Texts of more than one word that are no docstring, and docstrings of commands, which are their help."""
    inner = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node):
            is_command = isinstance(node, ast.FunctionDef) and any(
                isinstance(one, ast.Call) and getattr(one.func, "attr", "") in ("command", "callback")
                for one in node.decorator_list)
            if not is_command:
                inner.add(id(node.body[0].value))  # type: ignore[attr-defined]
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inner and (
                " " in node.value):
            yield node.lineno, node.value


def test_the_check_sees_what_it_should() -> None:
    tree = ast.parse('"""Beyond."""\ndef f():\n    raise ValueError(f"{1} mm beyond the rim")\n'
                     '@app.command()\ndef g():\n    """Solve afresh."""\n')
    assert {text for _, text in shown(tree) if RETIRED.search(text)} == {" mm beyond the rim", "Solve afresh."}
