"""Long records thinned to block means, so that a fit's memory and time stay bounded."""

from dataclasses import replace

import numpy as np

from matcal.fitting.relaxation.instantaneous_curve import runs
from matcal.laws.deformation_modes import MODES
from matcal.reduction.experiment import Experiment
from matcal.statistics.block_means import block_means, equal_blocks, log_blocks, sample_noise

LONG, KEPT = 3000, 1000  # points above which a record is thinned, and about how many are left
# points above which a relaxation record is thinned, and how many of each hold and of each ramp are left at most
_LONG_HOLD, _HOLD, _RAMP = 500, 120, 60


def thinned(experiment: Experiment) -> Experiment:
    """A stress-strain record of more than LONG points as means of about KEPT equal blocks, in the order of time, or of
    strain where it has no clock; the first row stays. A relaxation record of more than _LONG_HOLD points keeps its
    first row, means of ramps, and means of its holds equal in the log of their time. Others come back as they are."""
    n = experiment.strain.size
    if experiment.kind == "relaxation" and n > _LONG_HOLD:
        return _thinned_holds(experiment)
    if experiment.kind not in MODES or n <= LONG:
        return experiment
    order = np.arange(n) if experiment.time_s is not None else np.argsort(experiment.strain, kind="stable")
    edges = np.unique(np.r_[0, 1, 1 + equal_blocks(n - 1, KEPT), n])
    columns = {name: block_means(value[order], edges) for name in ("strain", "value", "time_s", "deviation", "lateral")
               if (value := getattr(experiment, name)) is not None}
    samples = np.diff(edges) if experiment.samples is None else np.add.reduceat(experiment.samples[order], edges[:-1])
    said = (f"{n} points are more than a fit needs: means of {edges.size - 1} blocks of neighbours in "
            f"{'time' if experiment.time_s is not None else 'strain'} stand for them.")
    return replace(experiment, **columns, samples=samples.astype(float), decisions=(*experiment.decisions, said))


def _thinned_holds(experiment: Experiment) -> Experiment:
    held, time = experiment.held, experiment.time_s
    if held is None or time is None or experiment.samples is not None:
        return experiment
    edges, at = [0, 1], 1
    for run in runs(held > 0, experiment.strain):
        edges += [*_even(at, run.start), *(run.start + log_blocks(time[run], _HOLD)).tolist()]
        at = run.stop
    cut = np.unique([*edges, *_even(at, held.size)])
    columns = {name: block_means(getattr(experiment, name), cut) for name in ("strain", "value", "time_s")}
    noise = experiment.noise or sample_noise(experiment.value[held > 0])
    said = (f"{held.size} points are more than a fit needs: its first row, means on ramps and means of its holds equal "
            f"in log time stand for them, {cut.size - 1} in all.")
    return replace(experiment, **columns, samples=np.diff(cut).astype(float), held=held[cut[:-1]], deviation=None,
                   noise=noise, decisions=(*experiment.decisions, said))


def _even(first: int, last: int) -> list[int]:
    """Edges of equal blocks, some of them the same where there are fewer samples than blocks."""
    return np.linspace(first, last, _RAMP + 1).astype(int).tolist()
