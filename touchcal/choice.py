"""A choice that a program makes, as data: code compares kinds, people read the words that a package makes of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, eq=False)
class Choice:
    """One choice, made once, executed, stored and counted by its kind."""

    kind: str  # of a StrEnum, or a name that is none of them
    values: Mapping[str, Any] = field(default_factory=dict)  # what its words state, SI
    cost: float | None = 0.0  # relative error that it may cost, at most; None where that is not known
