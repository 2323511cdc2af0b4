"""Loop of a cycle that repeats itself: the share of the stress that is missing until loading has come back to a turn.

On one side of rest x = |e|/e_max is the strain over the largest so far. Elements of one stiffness, whose slip lies
anywhere from 0 to half the strain `turn`, hold the loop: unloading by d from x = 1 misses f(d) = 2u - u^2 of it, with
u = min(d/turn, 1), loading again by d from there f(d) less, and a path that reaches an earlier turn goes on as if it
had never left it. First loading misses nothing, closed cycles return to their stress, and none gives work.

Source: Iwan, J. Appl. Mech. 33 (1966) 893, DOI 10.1115/1.3625199, with strains over the largest one.
"""

import numpy as np

from touchcal.arrays import Array


def missing(strain: Array, turn: float) -> Array:
    """(n,) share of the loop, 0 to 1, that is missing along a path of strains (n,) from rest; turn > 0."""
    out = np.zeros(strain.size)
    for side in (1.0, -1.0):
        own = np.maximum(side * strain, 0.0)
        if own.any():
            most = np.maximum.accumulate(own)
            x = np.divide(own, most, out=np.ones(own.size), where=most > 0)
            out = np.where(own > 0, _slipped(x, turn), out)
    return out


def _slipped(x: Array, turn: float) -> Array:
    """(n,) share along x in [0, 1] from 1, by the turns that later loading has not yet passed."""
    out, turns, last, share = [], [(1.0, 0.0)], 1.0, 0.0  # turns: (x, share), an upper one first, then lower and upper
    for at in x.tolist():
        if at != last and (at > last) == (len(turns) % 2 == 1):
            turns.append((last, share))
        rises = len(turns) % 2 == 0
        while len(turns) > 2 and (at >= turns[-2][0] if rises else at <= turns[-2][0]):
            del turns[-2:]
        if at >= 1.0:
            turns = [(1.0, 0.0)]
        begin, before = turns[-1]
        u = min(abs(at - begin) / turn, 1.0)
        share = before + (u * u - 2 * u if at > begin else 2 * u - u * u)
        last = at
        out.append(share)
    return np.array(out)
