"""Numbers of the softening of a loaded material (Mullins effect) and of the set that loading leaves."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Damage:
    """Numbers of the softening and the set."""

    r: float  # largest softening: eta is at least 1 - 1/r; > 1
    m_Pa: float  # energy over which it comes, J/m3, >= 0
    beta: float = 0.0  # share of the largest energy that it grows by, >= 0
    set_share: float = 0.0  # set over the largest strain, in [0, 1)

    def __post_init__(self) -> None:
        if not (self.r > 1 and self.m_Pa >= 0 and self.beta >= 0 and self.m_Pa + self.beta > 0
                and 0 <= self.set_share < 1):
            raise ValueError(f"damage: r must be above 1, m_Pa and beta not negative and not both 0, set_share in "
                             f"[0, 1), got r = {self.r:g}, m_Pa = {self.m_Pa:g}, beta = {self.beta:g}, set_share = "
                             f"{self.set_share:g}.")
