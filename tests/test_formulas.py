"""Formulas of pages and tutorials are known to the renderer of the site, which leaves unknown commands as they are."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [*sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs").glob("[he]*/*.md"))]
EXAMPLES = sorted((ROOT / "docs").glob("[tg]*/**/*.py"))

convert = pytest.importorskip("latex2mathml.converter", reason="the extra [docs] is not installed").convert


def in_markdown(text: str) -> list[str]:
    """Formulas between dollar signs, code left out."""
    text = re.sub(r"```.*?```|`[^`]*`", "", text, flags=re.DOTALL)
    return [block or inline for block, inline in re.findall(r"\$\$(.*?)\$\$|\$([^$]+)\$", text, flags=re.DOTALL)]


def in_rst(text: str) -> list[str]:
    """Formulas of the role and of the directive `math`."""
    blocks = re.findall(r"\.\. math:: (.*?)(?:\n\n|\"\"\"|\Z)", text, flags=re.DOTALL)
    return [*re.findall(r":math:`([^`]*)`", text), *blocks]


def unknown(formula: str) -> list[str]:
    """Commands of a formula that are left in its MathML."""
    return re.findall(r"\\[A-Za-z]+", convert(formula))


FORMULAS = [(page.name, formula) for pages, found in ((PAGES, in_markdown), (EXAMPLES, in_rst)) for page in pages
            for formula in found(page.read_text(encoding="utf-8"))]


def test_formulas_are_known() -> None:
    assert [(page, formula) for page, formula in FORMULAS if unknown(formula)] == []


def test_the_check_sees_what_it_should() -> None:
    assert {page for page, _ in FORMULAS} >= {"material-laws-and-fitting.md", "1_calibrate_a_foam.py"}
    assert unknown(r"a \foo b") == [r"\foo"]
    assert in_markdown("a $b$ `$c` $$\nd$$") == ["b", "\nd"]
