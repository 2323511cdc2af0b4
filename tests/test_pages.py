"""README and pages stay short, and what they point to is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# all but the first page of the site, whose links lead to what its build makes
PAGES = [ROOT / "README.md", *(page for folder in ("", "how-to", "explanation")
                               for page in sorted((ROOT / "docs" / folder).glob("*.md")) if page.stem != "site")]
MOST_LINES, MOST_WORDS, MOST_WORDS_A_PAGE = 120, 1200, 1500


def test_the_readme_is_one_page() -> None:
    text = PAGES[0].read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    assert len(text.split()) <= MOST_WORDS


@pytest.mark.parametrize("folder", ["how-to", "explanation"])
def test_pages_are_short(folder: str) -> None:
    words = {page.name: len(page.read_text(encoding="utf-8").split()) for page in (ROOT / "docs" / folder).glob("*.md")}
    assert words
    assert {name: count for name, count in words.items() if count > MOST_WORDS_A_PAGE} == {}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target, anchor in re.findall(r"\]\((?!https?:)([^)#]*)(#[^)]*)?\)", text):
        there = page.parent / target if target else page
        assert there.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.*)$", there.read_text(encoding="utf-8"), flags=re.MULTILINE)
            assert anchor[1:] in {re.sub(r"[^\w -]", "", h).lower().replace(" ", "-") for h in headings}, anchor


def test_every_page_is_in_the_index() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    for folder in ("how-to", "explanation"):
        for page in (ROOT / "docs" / folder).glob("*.md"):
            assert f"({folder}/{page.name})" in index, page.name
