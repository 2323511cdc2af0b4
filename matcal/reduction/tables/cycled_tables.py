"""Tables that hold whole cycles: their first loadings as the curve, and all their rows as the path."""

from dataclasses import replace

import numpy as np

from matcal.reduction.experiment import CROSSED_S, Experiment, StrainPath
from matcal.statistics.block_means import sample_noise


def with_path(experiment: Experiment) -> Experiment:
    """A table of loading and unloading (n,) as the rows that go further than all before, and the path of all rows."""
    e, p, time = experiment.strain, experiment.value, experiment.time_s
    side = 1.0 if abs(float(e.max())) >= abs(float(e.min())) else -1.0
    reach = np.maximum.accumulate(side * e)
    first = np.r_[True, (side * e)[1:] > reach[:-1]]
    first[0] = True
    pieces = int(np.count_nonzero(np.diff(first.astype(int)) > 0)) + 1
    path = StrainPath(e, p, time, sample_noise(p))
    kept = {name: column[first] for name in ("strain", "value", "deviation", "lateral")
            if (column := getattr(experiment, name)) is not None}
    crossed = time is not None and pieces > 1 and path.crosses
    said = f"{np.count_nonzero(first)} of {e.size} rows are first loading; all are the path that unloading follows." + (
        " They are not corrected for rate, since the path crosses from tension to compression." if crossed else "")
    facts = experiment.facts
    if time is not None and crossed:
        until = int(np.argmin(first)) if not first.all() else first.size
        facts = {**facts, CROSSED_S: float(time[until - 1] - time[0])}
    return replace(experiment, **kept, time_s=None if time is None or crossed else time[first], path=path, facts=facts,
                   decisions=(*experiment.decisions, said))
