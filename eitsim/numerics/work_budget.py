"""A bound on the work of a touch, counted and not timed, so that every machine gives up at the same place.

Work is counted in unknowns: those of a matrix that is factorised, a quarter of them for a product of a matrix and a
vector in conjugate gradients, which is about what their CPU times are to each other. A touch may take as much as a
number of factorisations on its finest mesh.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from touchcal.errors import NotConverged

# Cost of a product of conjugate gradients over that of a factorisation.
PRODUCT = 1 / 4


@dataclass
class WorkBudget:
    """What a touch may take, and has taken, in unknowns."""

    most: float
    spent: float = 0.0


_BUDGET: ContextVar[WorkBudget | None] = ContextVar("work of a touch", default=None)


@contextmanager
def bounded(factorisations: float, unknowns: int) -> Iterator[None]:
    """Minimisations within it stop once they took the work of so many factorisations of so many unknowns. Within
    another bound that one holds alone. A NotConverged that leaves it then says that the work was used up."""
    if _BUDGET.get() is not None:
        yield
        return
    token = _BUDGET.set(WorkBudget(factorisations * unknowns))
    try:
        yield
    except NotConverged as error:
        if not used_up():
            raise
        raise type(error)(f"{error} The search was given up after the work of {factorisations:.0f} factorisations on "
                          "the finest mesh.", estimate=error.estimate, residuals=error.residuals,
                          load_fraction=error.load_fraction) from None
    finally:
        _BUDGET.reset(token)


def charge(unknowns: float) -> None:
    """Add to the work of the touch that is being solved, if one is."""
    if budget := _BUDGET.get():
        budget.spent += unknowns


def used_up() -> bool:
    """Whether the touch that is being solved has taken all its work."""
    budget = _BUDGET.get()
    return budget is not None and budget.spent >= budget.most
