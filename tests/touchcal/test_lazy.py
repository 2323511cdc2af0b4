"""Public names of a package come with their first use, not with the package."""

from __future__ import annotations

import doctest
import sys
from pathlib import Path

import pytest

from touchcal import lazy


def test_a_name_is_imported_when_it_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "lazy_toy").mkdir()
    (tmp_path / "lazy_toy/__init__.py").write_text(
        "from typing import TYPE_CHECKING\nfrom touchcal.lazy import attach\n"
        "if TYPE_CHECKING:\n    from lazy_toy.inner import answer, absent\n"
        "__getattr__, __dir__, __all__ = attach(__name__, __file__)\n")
    (tmp_path / "lazy_toy/inner.py").write_text("answer = 42\n")
    monkeypatch.syspath_prepend(tmp_path)
    import lazy_toy  # pyright: ignore[reportMissingImports]

    assert dir(lazy_toy) == lazy_toy.__all__ == ["absent", "answer"]
    assert "lazy_toy.inner" not in sys.modules
    assert lazy_toy.answer == 42
    assert "lazy_toy.inner" in sys.modules
    assert vars(lazy_toy)["answer"] == 42
    with pytest.raises(AttributeError, match=r"lazy_toy.*no attribute 'question'.*absent, answer"):
        lazy_toy.question  # noqa: B018
    with pytest.raises(AttributeError, match="absent"):
        lazy_toy.absent  # noqa: B018


def test_the_example_runs() -> None:
    assert doctest.testmod(lazy).failed == 0
