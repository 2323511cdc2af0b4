"""What every fit of a Prony series has, whatever test it is from."""

from typing import Protocol

from matcal.laws.prony import Prony
from touchcal.arrays import Array


class Series(Protocol):
    """A fitted series and how well it is determined."""

    @property
    def prony(self) -> Prony:
        """The series."""
        ...

    @property
    def covariance(self) -> Array:
        """(2 M, 2 M) covariance of (g, tau_s)."""
        ...

    @property
    def further(self) -> Prony | None:
        """The series with a slower term that the test does not exclude; None where there is none."""
        ...

    @property
    def bounds_s(self) -> tuple[float, float]:
        """Shortest and longest time that the test sees, s."""
        ...

    @property
    def decisions(self) -> tuple[str, ...]:
        """What was decided, one sentence each."""
        ...
