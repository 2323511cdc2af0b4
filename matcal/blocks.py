"""Long stress-strain records thinned to block means, so that a fit's memory and time stay bounded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from matcal.experiment import Experiment
from matcal.modes import MODES
from matcal.thinning import block_means, equal_blocks

# points above which a record is thinned, and about how many are left
LONG, KEPT = 3000, 1000


def thinned(experiment: Experiment) -> Experiment:
    """A stress-strain record of more than LONG points as means of about KEPT equal blocks, in the order of time, or of
    strain where it has no clock; the first row stays. Other experiments come back as they are."""
    n = experiment.strain.size
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
