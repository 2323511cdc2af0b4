"""Compilation of the hot loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from numba import njit

Result = TypeVar("Result")


def compiled(function: Callable[..., Result]) -> Callable[..., Result]:
    """Compile a loop over arrays; kept on disk where there is a place to write, else compiled by each process."""
    try:
        return njit(cache=True)(function)
    except RuntimeError:
        return njit(function)
