"""How well one to six probes at once are read on a recorded skin, and what its readings allow.

Usage: python benchmarks/six_points.py. Reads `sixpoint` in ../shared/real, which others measured, and stops where it is
not there. Adds to results/six_points.csv the sessions that it lacks: all_right is the share of tested presses of which
all six probes are right, count_right likewise of their number, count_probability the mean probability that was stated.
What is taught and tested: "one and two, three to six"; "one, two"; "five folds, three to six": presses of all kinds but
a fifth teach, and that fifth is tested. Two more rows are simulated, of sets of three to six probes, `tested` of them:

- "known, Gaussian noise": patterns, pairs and covariance of the noise are those that all presses teach, and known. No
  reader that takes the rounding of the board for such noise is better; `weakest` is the distance of the probe that
  changes readings least from none, in standard deviations.
- "known, rounding": the same patterns; each of three scans is rounded as the board rounds, noise before that is
  independent, as large as makes untouched scans differ as often as they do, and known, as is the untouched level. No
  reader knows that level exactly, so this is more than a reader can reach.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written
from real_skins import REAL
from scipy.special import ndtr

import eitsim
import surrogate
from eitsim.sensors.recording import Recording
from eitsim.sensors.touch_sets import TouchSets
from surrogate.model.recorded.set_model import SetModel
from surrogate.recordings.several.set_reader import SetReader
from surrogate.recordings.several.superposition import design_of
from touchcal.arrays import Array, Index, Mask

NAME, FOLDER = "six_points", REAL / "sixpoint"
DRAWS = quick(100, 5)  # of each set
FOLDS = 5
STEP_V, SCANS, UNTOUCHED_SCANS = 2.2 / 1024, 3, 2  # of the board; whose means a touched and an untouched frame hold
Row = dict[str, object]


def chosen(sets: TouchSets, rows: Mask) -> TouchSets:
    """Some of the touches."""
    return replace(sets, touch=sets.touch[rows], down=sets.down[rows])


def scored(model: SetModel, recording: Recording, sets: TouchSets) -> Row:
    score = model.score(recording, sets)
    return {"trained": score.trained, "tested": score.tested, "all_right": score.all_right,
            "count_right": score.count_right, "count_probability": score.count_probability}


def read(recording: Recording, sets: TouchSets) -> Iterator[Row]:
    """What our reader does."""
    count = sets.down.sum(axis=1)
    for name, taught, tested in (("one and two, three to six", count <= 2, count > 2), ("one, two", count == 1,
                                                                                        count == 2)):
        yield {"what": name} | scored(surrogate.learn_sets(recording, chosen(sets, taught)), recording,
                                      chosen(sets, tested))
    fold = np.random.default_rng(0).permutation(len(count)) % FOLDS
    each = [scored(surrogate.learn_sets(recording, chosen(sets, fold != one)), recording,
                   chosen(sets, (fold == one) & (count > 2))) for one in range(FOLDS)]
    share = np.array([one["tested"] for one in each], float)
    yield {"what": "five folds, three to six"} | {
        key: value if key == "trained" else share.sum() if key == "tested" else float(
            share @ [one[key] for one in each] / share.sum()) for key, value in each[0].items()}


def possible(recording: Recording, sets: TouchSets) -> Iterator[Row]:
    """What readers that know patterns and noise would do."""
    reader = surrogate.learn_sets(recording, sets).reader
    means, down = means_of(reader), reader.sets
    truth = np.repeat(np.flatnonzero(down.sum(axis=1) > 2), DRAWS)
    rng = np.random.default_rng(0)
    white = np.linalg.solve(np.linalg.cholesky(reader.superposition.covariance), means.T).T
    drawn = white[truth] + rng.standard_normal((len(truth), white.shape[1]))
    found = np.argmin(np.sum(white**2, axis=1) - 2 * drawn @ white.T, axis=1)
    alone = white[down.sum(axis=1) == 1]
    yield row("known, Gaussian noise", down, truth, found) | {"weakest": np.linalg.norm(alone, axis=1).min()}
    untouched = recording.readings[recording.touch == ""][:, reader.used] * UNTOUCHED_SCANS / STEP_V
    noise = np.sqrt(np.pi) / 2 * np.mean(np.round(untouched).astype(int) % UNTOUCHED_SCANS, axis=0)
    level = rng.uniform(-0.5, 0.5, (len(truth), means.shape[1]))
    found = np.array([likeliest(at, means[true] / STEP_V, means / STEP_V, noise, rng)
                      for at, true in zip(level, truth, strict=True)])
    yield row("known, rounding", down, truth, found)


def means_of(reader: SetReader) -> Array:
    """(s, m) expected signals of all sets."""
    learnt = reader.superposition
    return learnt.means(design_of(reader.sets.astype(float), learnt.pairs))


def likeliest(level: Array, true: Array, means: Array, noise: Array, rng: np.random.Generator) -> int:
    """The likeliest of sets of signals (s, m) of which one, (m,), is scanned over a level (m,), all in steps."""
    scans = np.round(level + true + noise * rng.standard_normal((SCANS, len(level))))
    above, below = ((scans[:, None] + half - level - means) / noise for half in (0.5, -0.5))
    return int(np.log(np.maximum(ndtr(above) - ndtr(below), 1e-12)).sum(axis=(0, 2)).argmax())


def row(what: str, down: Mask, truth: Index, found: Index) -> Row:
    count = np.asarray(down.sum(axis=1))
    return {"what": what, "tested": len(truth), "all_right": np.mean(found == truth),
            "count_right": np.mean(count[found] == count[truth])}


def main() -> None:
    if not FOLDER.is_dir():
        print(f"{FOLDER} is not there; nothing is measured.")
        return
    table = earlier(NAME)
    for session in quick((1, 2), (2,)):
        if not len(table) or session not in set(table["session"]):
            recording = eitsim.read_recording(FOLDER / f"session{session}_frames.csv", kind="magnitude")
            sets = surrogate.read_touch_sets(FOLDER / f"session{session}_touches.csv")
            rows = pd.DataFrame([{"session": session} | one for part in (read, possible)
                                 for one in part(recording, sets)])
            shown(rows)
            table = written(pd.concat([table, rows], ignore_index=True), NAME)


if __name__ == "__main__":
    main()
