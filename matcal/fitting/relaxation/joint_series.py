"""One series of holds and a dynamic test: what each weighs, its moduli in the joint series, and whether both agree."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from matcal.fitting.relaxation.prony_search import series_at, vector_of
from matcal.fitting.relaxation.relaxation_fit import PronyFit, Together
from matcal.fitting.relaxation.seen_sweep import SeenSweep, seen_sweep
from matcal.fitting.relaxation.spectrum_fit import SpectrumFit
from matcal.reduction.experiment import Experiment
from matcal.statistics.central_differences import slopes
from matcal.statistics.residual_correlation import integrated_autocorrelation_time
from touchcal.arrays import Array

_CHANCE = 1e-3  # chance that tests which agree are said to disagree
_FINEST = 1e-4  # relative RMS below which no test says anything


@dataclass(frozen=True)
class JointSeries:
    """How much worse one series follows the tests than each its own."""

    relative_rms_alone: tuple[float, ...]  # of each hold, then of storage and loss modulus, by their own series
    excess: float  # chi-square of the joint series over those of their own
    freedom: int  # numbers that their own have more

    @property
    def disagree(self) -> bool:
        """Whether the tests say different things of one material, beyond their errors."""
        return self.excess > float(chdtri(self.freedom, _CHANCE))


def together(experiment: Experiment, spectrum: SpectrumFit, alone: PronyFit) -> Together:
    """A dynamic test, to be fitted with holds, by what the series of each alone leaves of it."""
    return Together((seen_sweep(experiment, spectrum),),
                    tuple(float(np.sqrt(np.mean(left**2))) for left in _left(alone)))


def joint_series(alone: PronyFit, spectrum: SpectrumFit, joint: PronyFit) -> JointSeries:
    """Misfits of the joint series over those of each test's own; both as many independent points as its own leaves."""
    (sweep,) = joint.sweeps
    own = [*_left(alone), sweep.precision * (np.concatenate(spectrum.fitted) - sweep.moduli_Pa)]
    both = [*_left(joint, alone), sweep.precision * (_moduli(sweep, joint) - sweep.moduli_Pa)]
    sizes = [*((h.precision * h.stress_Pa)[h.precision > 0] for h in alone.holds), sweep.precision * sweep.moduli_Pa]
    excess = sum(_excess(a, b, size) for a, b, size in zip(own, both, sizes, strict=True))
    freedom = 2 * (alone.prony.g.size + np.count_nonzero(spectrum.prony.g) - joint.prony.g.size)
    return JointSeries((*alone.relative_rms, *spectrum.relative_rms), excess, max(int(freedom), 1))


def _excess(own: Array, both: Array, size: Array) -> float:
    floor = _FINEST**2 * float(size @ size)
    points = own.size / integrated_autocorrelation_time(own)
    return points * float(np.log(max(float(both @ both), floor) / max(float(own @ own), floor)))


def _left(fit: PronyFit, stated: PronyFit | None = None) -> list[Array]:
    """What a series leaves of each hold, over the noise that it states."""
    return [(h.precision * (stress - h.stress_Pa))[h.precision > 0]
            for h, stress in zip((stated or fit).holds, fit.stress_Pa, strict=True)]


def _moduli(sweep: SeenSweep, joint: PronyFit) -> Array:
    return sweep.size(joint.prony) * sweep.unit(joint.prony)


def joined(spectrum: SpectrumFit, joint: PronyFit) -> SpectrumFit:
    """The dynamic test as the joint series follows it, with its own instantaneous modulus."""
    (sweep,) = joint.sweeps
    fitted = _moduli(sweep, joint)
    relative = (fitted / sweep.moduli_Pa - 1).reshape(2, -1)
    value, u = sweep.size(joint.prony), sweep.precision * sweep.unit(joint.prony)
    moved = slopes(lambda v: np.log([sweep.size(series_at(v))]), vector_of(joint.prony))
    turn = slopes(lambda v: np.r_[series_at(v).g, series_at(v).tau_s], vector_of(joint.prony))
    by_series = (moved @ np.linalg.pinv(turn))[0]
    points = joint.effective_sample_size / sum(t.basis.shape[0] for t in joint.tables())
    square = float(by_series @ joint.covariance @ by_series) + 1 / (u @ u * min(points, 1.0)) / value**2
    return replace(spectrum, prony=joint.prony, covariance=joint.covariance, modulus_Pa=value,
                   modulus_sd_Pa=value * float(np.sqrt(square)), g_infinity_sd=joint.g_infinity_sd,
                   fitted=tuple(fitted.reshape(2, -1)),
                   relative_rms=tuple(float(np.sqrt(np.mean(r**2))) for r in relative),
                   decisions=(_how(spectrum), *(spectrum.decisions[-1:] if spectrum.shift else ())))


def _how(spectrum: SpectrumFit) -> str:
    at = f" Holds count as measured at {spectrum.shift.law.reference_K - 273.15:.4g} C." if spectrum.shift else ""
    return ("One series of holds and dynamic test, each with an instantaneous modulus of its own and weighed by what a "
            f"series of its own leaves of it.{at}")
