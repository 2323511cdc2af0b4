"""A dynamic test next to holds: one more table of the same series, with its own modulus and its own noise.

Over its instantaneous modulus storage and loss are g_inf (1, 0) + sum g_i (Re, Im) of i w tau_i/(1 + i w tau_i): linear
in the shares at given times, as the stress of a hold is.
"""

from dataclasses import dataclass, replace

import numpy as np

from matcal.fitting.relaxation.hold_table import HoldTable, tabulated
from matcal.fitting.relaxation.spectrum_fit import SpectrumFit
from matcal.laws.prony import Prony, dynamic
from matcal.reduction.experiment import Experiment
from touchcal.arrays import Array

_EARLIER = 0.1  # shortest time that is searched over that of the highest frequency, whose loss still shows it


@dataclass(frozen=True)
class SeenSweep:
    """A dynamic test as a fit of a series sees it."""

    omega_rad_per_s: Array  # (n,) at the temperature of the series
    moduli_Pa: Array  # (2 n,) storage, then loss modulus
    precision: Array  # (2 n,) one over the standard deviation of its noise
    moves: Array  # (n, J) change of ln omega for one standard deviation of each shift with temperature

    @property
    def ends_s(self) -> tuple[float, float]:
        """Shortest and longest time that it sees, s."""
        return 1 / float(self.omega_rad_per_s.max()), 1 / float(self.omega_rad_per_s.min())

    @property
    def shortest_s(self) -> float:
        """Shortest time that is searched, s."""
        return _EARLIER * self.ends_s[0]

    def unit(self, prony: Prony) -> Array:
        """(2 n,) moduli of a series over the instantaneous one."""
        z = dynamic(prony, self.omega_rad_per_s)
        return np.r_[z.real, z.imag]

    def size(self, prony: Prony) -> float:
        """Best instantaneous modulus of a series, Pa."""
        u = self.precision * self.unit(prony)
        return float(u @ (self.precision * self.moduli_Pa) / (u @ u))

    def doubts(self, prony: Prony) -> Array:
        """(2 n, J) weighted change for one standard deviation of each shift with temperature."""
        moved = [replace(self, omega_rad_per_s=self.omega_rad_per_s * np.exp(by)) for by in self.moves.T]
        change = [self.size(prony) * (m.unit(prony) - self.unit(prony)) for m in moved]
        return (self.precision * np.reshape(change, (len(moved), self.precision.size))).T


def seen_sweep(experiment: Experiment, alone: SpectrumFit) -> SeenSweep:
    """The test with the noise that the series of its own leaves; the loss modulus has at least that of the storage."""
    assert experiment.sweep is not None
    assert alone.master_Hz is not None
    storage, loss = alone.relative_rms
    moduli = np.r_[experiment.value, experiment.sweep.loss_Pa]
    relative = np.repeat([storage, max(loss, storage)], experiment.value.size)
    moves = np.zeros((experiment.value.size, 0)) if alone.shift is None else (
        np.log(10) * alone.shift.moves[experiment.sweep.group])
    return SeenSweep(2 * np.pi * alone.master_Hz, moduli, 1 / (relative * moduli), moves)


def tabulate_sweep(sweep: SeenSweep, bounds_s: tuple[float, float], more: Array | None = None) -> HoldTable:
    """Table for times within `bounds_s`; `more` (2 n, J) are further vectors that the basis must hold."""
    def slow(times_s: Array) -> Array:
        turn = 1j * sweep.omega_rad_per_s * times_s[:, None]
        z = turn / (1 + turn)
        return (sweep.precision * np.concatenate([z.real, z.imag], axis=1))[:, :, None]

    elastic = np.repeat([1.0, 0.0], sweep.omega_rad_per_s.size)
    return tabulated((sweep.precision * elastic)[:, None], slow, sweep.precision * sweep.moduli_Pa, bounds_s, more)
