"""Dynamic tests and creep as linear in the moduli, or the compliances, of given times; residuals are relative."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from matcal.laws.histories.creep_series import relaxation_of
from matcal.reduction.experiment import Experiment, Sweep
from touchcal.arrays import Array

_TURNS, _FINEST = 4, 1e-5  # turns of weights; least relative misfit of a channel


@dataclass(frozen=True)
class LinearSpectrum:
    """Channels (n,) are columns(times) (n, M + 1) @ what is to be found."""

    channels: tuple[Array, ...]
    columns: Callable[[Array], tuple[Array, ...]]
    series: Callable[[Array, Array], tuple[Array, Array]]  # (found, times) -> ((E_inf, E_i), tau_s)

    @property
    def points(self) -> int:
        """Measured values of all channels."""
        return sum(c.size for c in self.channels)

    def relative(self, times_s: Array) -> list[Array]:
        """(n, M + 1) columns of each channel over what was measured."""
        return [c / y[:, None] for c, y in zip(self.columns(times_s), self.channels, strict=True)]


@dataclass(frozen=True)
class AtTimes:
    """The best non-negative coefficients at given times."""

    times_s: Array  # (M,)
    found: Array  # (M + 1,) coefficients, the first without a time
    rms: tuple[float, ...]  # relative misfit of each channel

    def row(self, model: LinearSpectrum, searched: int = 0) -> tuple[int, float, float]:
        """(times, relative RMS, BIC), each channel with a noise of its own, of which `searched` times were fitted."""
        counts = [c.size for c in model.channels]
        square = sum(n * r**2 for n, r in zip(counts, self.rms, strict=True))
        bic = sum(2 * n * np.log(r) for n, r in zip(counts, self.rms, strict=True)) + (
            np.count_nonzero(self.found) + searched) * np.log(sum(counts))
        return self.times_s.size, float(np.sqrt(square / sum(counts))), float(bic)


def of_sweep(storage_Pa: Array, sweep: Sweep, omega: Array) -> LinearSpectrum:
    """Storage and loss modulus in E_inf, E_i."""
    def columns(times: Array) -> tuple[Array, ...]:
        turn = 1j * omega[:, None] * times
        each = np.column_stack([np.ones(omega.size), turn / (1 + turn)])
        return each.real, each.imag

    return LinearSpectrum((storage_Pa, sweep.loss_Pa), columns, lambda found, times: (found, times))


def of_creep(experiment: Experiment) -> LinearSpectrum:
    """Compliance in J_0, J_i, which relaxes as `matcal.laws.histories.creep_series` says."""
    t = experiment.time_s
    assert t is not None

    def columns(times: Array) -> tuple[Array, ...]:
        return (np.column_stack([np.ones(t.size), -np.expm1(-t[:, None] / times)]),)

    def series(found: Array, times: Array) -> tuple[Array, Array]:
        seen = found[1:] > 0
        rest, moduli, tau = relaxation_of(found[0], found[1:][seen], times[seen])
        return np.r_[rest, moduli], tau

    return LinearSpectrum((experiment.value,), columns, series)


def at_times(model: LinearSpectrum, times_s: Array) -> AtTimes:
    """Non-negative least squares of relative residuals. The first channel is fitted alone, then all, each counting by
    its own misfit and none more than the first: a loss modulus that no linear material has next to the storage modulus
    does not pull that from its values."""
    blocks = model.relative(times_s)

    def misfits(found: Array) -> list[float]:
        return [max(float(np.sqrt(np.mean((b @ found - 1) ** 2))), _FINEST) for b in blocks]

    found = positive(blocks[:1], [1.0])[0]
    for _ in range(_TURNS if len(blocks) > 1 else 0):
        rms = misfits(found)
        found = positive(blocks, [max(r, rms[0]) for r in rms])[0]
    return AtTimes(times_s, found, tuple(misfits(found)))


def positive(blocks: Sequence[Array], rms: Sequence[float]) -> tuple[Array, float]:
    """Coefficients >= 0 with which every row of the blocks, over the misfit of its block, is nearest 1 over it, and the
    norm of what they leave."""
    rows, right = stacked(blocks, rms)
    size = np.linalg.norm(rows, axis=0)
    found, left = nnls(rows / size, right, maxiter=100 * rows.shape[1])
    return np.asarray(found / size), float(left)


def stacked(blocks: Sequence[Array], rms: Sequence[float]) -> tuple[Array, Array]:
    """(n, M + 1) rows of all blocks and (n,) what they are to be, each over the misfit of its block."""
    return (np.vstack([b / r for b, r in zip(blocks, rms, strict=True)]),
            np.concatenate([np.full(b.shape[0], 1 / r) for b, r in zip(blocks, rms, strict=True)]))
