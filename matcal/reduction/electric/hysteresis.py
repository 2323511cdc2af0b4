"""What a conductor that is let go conducts against what it conducted on the way, at the same strain."""

from dataclasses import replace

import numpy as np

from matcal.reduction.experiment import Experiment
from matcal.statistics.block_means import sample_noise

# least change that is said, and in its standard errors; points of each way; strains at which both are compared
_LEAST, _SURE, _FEWEST, _STRAINS = 0.02, 3.0, 5, 50


def with_hysteresis(test: Experiment) -> Experiment:
    """The conductivity test with its hysteresis, mean c of unloading over that of loading less 1, at the strains of
    both, among its facts and cautions; unchanged without unloading, or where noise hides it."""
    e, c = np.abs(test.strain), test.value
    if e.size < 2 * _FEWEST:
        return test
    steps = np.gradient(e)
    up, down = (np.flatnonzero(way) for way in (steps > 0, steps < 0))
    if min(up.size, down.size) < _FEWEST:
        return test
    low, high = max(e[up].min(), e[down].min()), min(e[up].max(), e[down].max())
    if high <= low:
        return test
    at = np.linspace(low, high, _STRAINS)
    sorted_ways = (way[np.argsort(e[way], kind="stable")] for way in (up, down))
    loading, unloading = (np.interp(at, e[way], c[way]) for way in sorted_ways)
    share = float(np.mean(unloading) / np.mean(loading)) - 1
    error = sample_noise(c) / float(np.mean(c)) * float(np.hypot(up.size**-0.5, down.size**-0.5))
    if abs(share) < max(_LEAST, _SURE * error):
        return test
    said = (f"{', '.join(test.source)} conducts {abs(share):.1%} {'more' if share > 0 else 'less'} in unloading than "
            "in loading at the same strain (hysteresis): the law follows both ways, and so the mean of them.")
    return replace(test, facts={**test.facts, "conduction_hysteresis": share}, cautions=(*test.cautions, said))
