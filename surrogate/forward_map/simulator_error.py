"""The relative error that the simulator states of its signals, by the gap between punch and rim."""

from dataclasses import dataclass

import numpy as np

from touchcal.arrays import Array

BINS, FEWEST = 16, 14  # bins of equal count at most, and fewest rows of one


@dataclass(frozen=True, eq=False)
class SimulatorError:
    """Standard deviations of the size of signals, linear between the middles of bins of the gap."""

    gap: Array  # (bins,) mean gap over the disc's radius
    sd: Array  # (bins,) RMS of what rows state


def learned_from(gap: Array, sd: Array) -> SimulatorError:
    """From gaps over the disc's radius and stated standard deviations (n,) of rows."""
    bins = np.array_split(np.argsort(gap), int(np.clip(len(gap) // FEWEST, 1, BINS)))
    return SimulatorError(np.array([gap[b].mean() for b in bins]),
                          np.array([np.sqrt(np.mean(sd[b] ** 2)) for b in bins]))


def at(error: SimulatorError, gap: Array) -> Array:
    """(n,) standard deviations at gaps (n,)."""
    return np.interp(gap, error.gap, error.sd)
