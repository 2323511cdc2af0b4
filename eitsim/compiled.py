"""Compilation of the hot loops."""

from __future__ import annotations

from collections.abc import Callable

from numba import njit


def compiled(function: Callable[..., None]) -> Callable[..., None]:
    """Compile a loop over arrays; kept on disk where there is a place to write, else compiled by each process."""
    try:
        return njit(cache=True)(function)
    except RuntimeError:
        return njit(function)
