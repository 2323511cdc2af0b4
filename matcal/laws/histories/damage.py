"""Numbers of the softening of a loaded material (Mullins effect), of the set that loading leaves and of its loop."""

from dataclasses import dataclass

MOST_LOOP = 0.95  # largest share of a loop that fits search


@dataclass(frozen=True)
class Damage:
    """Numbers of the softening, the set and the loop of a cycle that repeats itself."""

    r: float  # largest softening: eta is at least 1 - 1/r; > 1
    m_Pa: float  # energy over which it comes, J/m3, >= 0
    beta: float = 0.0  # share of the largest energy that it grows by, >= 0
    set_share: float = 0.0  # set over the largest strain, in [0, 1)
    loop_share: float = 0.0  # share of the softened stress that unloading lacks against loading, in [0, 1)
    loop_turn: float = 0.0  # strain over the largest one in which a turn passes to the other branch

    def __post_init__(self) -> None:
        if not (self.r > 1 and self.m_Pa >= 0 and self.beta >= 0 and self.m_Pa + self.beta > 0
                and 0 <= self.set_share < 1):
            raise ValueError(f"damage: r must be above 1, m_Pa and beta not negative and not both 0, set_share in "
                             f"[0, 1), got r = {self.r:g}, m_Pa = {self.m_Pa:g}, beta = {self.beta:g}, set_share = "
                             f"{self.set_share:g}.")
        if not (0 <= self.loop_share < 1 and self.loop_turn >= 0 and (self.loop_turn > 0 or self.loop_share == 0)):
            raise ValueError(f"damage: loop_share must be in [0, 1) and loop_turn above 0 where it is not 0, got "
                             f"loop_share = {self.loop_share:g}, loop_turn = {self.loop_turn:g}.")
