"""Readers of places next to ours, each with the intervals that it gives itself: distance, coverage, width, flags.

Usage: python benchmarks/reader_league.py [methods ...]. Reads the recordings in ../shared/real, which others measured,
and stops where they are not there. Draws of labels are those of few_labels.py; the last fifth in time tests: as
recorded, with `dead` readings drawn by the draw, against the untouched frame `age` presses before where there is one,
and that of another session of the skin, read as the first taught or, five presses of it being labelled as well, by
our reader continued and by the others taught these too. Dead readings are filled in for the others by their mean given
the rest. Scored by what `surrogate audit` says of a table of predictions, flags left out; flagged is the part of the
frames with a flag (ours alone has flags), unflagged_in_90 the lesser part of x or y that intervals of the other frames
hold. Adds to results/reader_league.csv the rows that it lacks, means over `draws`; worst_mm is the largest distance,
least_in_90 the least part of x or y in any draw, `holds` the part of the draws in which the audit's test passes,
interval_score_mm the mean of Gneiting and Raftery (2007, equation 43), which is the width and 20 times what a place
lies outside: lower is better; cpu_s of learning once and reading all. Methods:

ours           families, with the sensor file
ridge          linear, penalty by leaving one out; intervals by the residuals so left (Vovk, conformal prediction)
kernel ridge   as our yardstick, likewise
gp             Gaussian process, squared exponential, by marginal likelihood; its own standard deviation
ensemble       five networks with a mean and a variance each (Lakshminarayanan et al., NIPS 2017)
dropout        one such network, dropout kept while it reads (Gal and Ghahramani, ICML 2016)
npe            neural posterior estimation: a mixture of Gaussians by a network (Papamakarios and Murray, NIPS 2016)

All but ours read the same standardised features, both views of the signal that our networks take; networks stop where
a fifth of the presses, held out, are likeliest.
"""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import another_session
import few_labels
import numpy as np
import pandas as pd
import torch
from conditions import earlier, quick, shown, written
from real_skins import REAL, read_old, recorded
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize
from torch import Tensor, nn

from eitsim.sensors.labels import Labels, labels_of
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import read_sensor
from surrogate.model.recorded.continued import FEWEST, continued
from surrogate.model.recorded.reader_evaluation import evaluate_predictions
from surrogate.model.recorded.reader_scores import split_rows
from surrogate.recordings import kernel_ridge, press_reader
from surrogate.recordings.dead_channels import filled, learn_readings
from surrogate.recordings.patterns import learn_features
from surrogate.recordings.physics.expectation import expectation_of
from surrogate.recordings.presses import Presses, taken
from surrogate.statistics.conformal import COVERAGE, conformal_scale, normal
from surrogate.statistics.gaussian_process import squared_distance
from touchcal.arrays import Array, Mask

NAME = "reader_league"
SKINS = quick(("skin_plain", "hydrogel", "skin_carbon_session1"), ("hydrogel",))
LABELS, DRAWS, DEAD, OLD = quick((20, 100), (20,)), quick(3, 1), 10, 20
SECOND = {"skin_carbon_session1": "skin_carbon"}
TAUGHT = "second, five taught"
PENALTIES = 10.0 ** np.arange(-4, 3)  # of ridge regression, over the mean eigenvalue
HIDDEN, DROPOUT, STEPS, BATCH, EVERY = 128, 0.1, 1500, 64, 25
RATE, DECAY, NOISE = 1e-3, 0.05, 0.1  # of AdamW; of the standardised inputs
NETWORKS, PASSES, PARTS, DRAWN = 5, 100, 5, 1000


@dataclass(frozen=True, eq=False)
class Read:
    """Places of tested presses, (n, 2) each, mm."""

    value: Array
    low: Array
    high: Array


Learn = Callable[[Array, Array, Array, int], Read]  # signals, places, tested signals, seed


def ridge(signal: Array, place: Array, tested: Array, _: int) -> Read:
    """f -> mean + f B, B of the penalty whose left-out residuals are least."""
    features, mean = learn_features(signal), place.mean(axis=0)
    rows, asked = features.of(signal), features.of(tested)
    kernel = rows @ rows.T
    tried = []
    for penalty in PENALTIES * np.trace(kernel) / len(rows):
        inverse = np.linalg.inv(kernel + penalty * np.eye(len(rows)) + np.trace(kernel))  # the constant is free
        left = inverse @ (place - mean) / np.diag(inverse)[:, None]
        tried.append((float(np.mean(left**2)), inverse, left))
    _, inverse, left = min(tried, key=lambda one: one[0])
    value = mean + (asked @ rows.T + np.trace(kernel)) @ inverse @ (place - mean)
    return about(value, conformal_scale(left, np.ones_like(left), len(left)))


def yardstick(signal: Array, place: Array, tested: Array, _: int) -> Read:
    """Kernel ridge regression."""
    fitted = kernel_ridge.fit(signal, place)
    left = kernel_ridge.held_out(fitted, signal, place, np.arange(len(place))) - place
    return about(fitted.read(tested), conformal_scale(left, np.ones_like(left), len(left)))


def gp(signal: Array, place: Array, tested: Array, _: int) -> Read:
    """y ~ N(mean, a^2 exp(-d^2 / 2 l^2) + s^2), x and y of one kernel."""
    features, mean, spread = learn_features(signal), place.mean(axis=0), place.std()
    rows, asked, y = features.of(signal), features.of(tested), (place - mean) / spread
    between = squared_distance(rows, rows)
    usual = float(np.median(between[between > 0]))

    def kernel(square: Array, log: Array) -> Array:
        return np.exp(2 * log[0] - square / (2 * usual * np.exp(2 * log[1])))

    def missed(log: Array) -> float:
        factor = cho_factor(kernel(between, log) + np.exp(2 * log[2]) * np.eye(len(y)), lower=True)
        return float(np.sum(y * cho_solve(factor, y)) / 2 + 2 * np.sum(np.log(np.diag(factor[0]))))

    starts = ([0.0, length, noise] for length in (-0.5, 0.5) for noise in (-2.0, -0.7))
    log = min((minimize(missed, start, method="L-BFGS-B", bounds=[(-3, 3), (-2, 3), (-5, 1)]) for start in starts),
              key=lambda one: one.fun).x
    factor = cho_factor(kernel(between, log) + np.exp(2 * log[2]) * np.eye(len(y)))
    across = kernel(squared_distance(asked, rows), log)
    variance = np.exp(2 * log[0]) + np.exp(2 * log[2]) - np.sum(across * cho_solve(factor, across.T).T, axis=1)
    return about(mean + spread * across @ cho_solve(factor, y), normal(COVERAGE) * spread * np.sqrt(variance)[:, None])


def networks(signal: Array, place: Array, tested: Array, seed: int, *, count: int, passes: int) -> Read:
    """Mixture of normal distributions, one a network and pass; dropout while it reads where there are several."""
    each = [trained(signal, place, tested, NETWORKS * seed + one, 4, gaussian, DROPOUT if passes > 1 else 0.0, passes)
            for one in range(count)]
    out = torch.cat(each).double().numpy()
    mean, spread = place.mean(axis=0), place.std()
    value, variance = out[..., :2], np.exp(out[..., 2:])
    sd = np.sqrt(value.var(axis=0) + variance.mean(axis=0))
    return about(mean + spread * value.mean(axis=0), normal(COVERAGE) * spread * sd)


def npe(signal: Array, place: Array, tested: Array, seed: int) -> Read:
    """Quantiles of draws from the mixture that a network gives of a place."""
    out = trained(signal, place, tested, seed, 5 * PARTS, lambda out, y: -mixture(out).log_prob(y).mean(), 0.0, 1)[0]
    torch.manual_seed(seed)
    drawn = (place.mean(axis=0) + place.std() * mixture(out).sample((DRAWN,)).double().numpy())
    low, high = np.quantile(drawn, [(1 - COVERAGE) / 2, (1 + COVERAGE) / 2], axis=0)
    return Read(drawn.mean(axis=0), low, high)


def gaussian(out: Tensor, y: Tensor) -> Tensor:
    """Mean of minus the logarithm of the density of y (n, 2) by means and logarithms of variances (n, 4)."""
    return ((y - out[:, :2]) ** 2 * torch.exp(-out[:, 2:]) + out[:, 2:]).mean() / 2


def mixture(out: Tensor) -> torch.distributions.MixtureSameFamily:
    """Gaussians (n,) of PARTS parts whose weights, means and logarithms of standard deviations are (n, 5 PARTS)."""
    weight, mean, log = out.split([PARTS, 2 * PARTS, 2 * PARTS], dim=1)
    each = torch.distributions.Normal(mean.view(-1, PARTS, 2), log.clamp(-6, 2).exp().view(-1, PARTS, 2))
    return torch.distributions.MixtureSameFamily(torch.distributions.Categorical(logits=weight),
                                                 torch.distributions.Independent(each, 1))


def trained(signal: Array, place: Array, tested: Array, seed: int, outputs: int,
            loss: Callable[[Tensor, Tensor], Tensor], dropout: float, passes: int) -> Tensor:
    """(passes, n, outputs) what a network says of tested signals, as it was where a fifth of the presses, that did not
    train, was likeliest."""
    torch.manual_seed(seed)
    features = learn_features(signal)
    x, asked = (torch.tensor(features.of(one), dtype=torch.float32) for one in (signal, tested))
    y = torch.tensor((place - place.mean(axis=0)) / place.std(), dtype=torch.float32)
    order = torch.randperm(len(x))
    held, rows = order[:len(x) // 5], order[len(x) // 5:]
    net = nn.Sequential(nn.Linear(x.shape[1], HIDDEN), nn.GELU(), nn.Dropout(dropout), nn.Linear(HIDDEN, HIDDEN),
                        nn.GELU(), nn.Dropout(dropout), nn.Linear(HIDDEN, outputs))
    steps = torch.optim.AdamW(net.parameters(), lr=RATE, weight_decay=DECAY)
    best, kept = np.inf, net.state_dict()
    for step in range(STEPS):
        some = rows[torch.randint(len(rows), (min(BATCH, len(rows)),))]
        steps.zero_grad()
        loss(net(x[some] + NOISE * torch.randn_like(x[some])), y[some]).backward()
        steps.step()
        if step % EVERY == 0:
            with torch.no_grad():
                net.eval()
                now = float(loss(net(x[held]), y[held]))
                net.train()
            if now < best:
                best, kept = now, {name: value.clone() for name, value in net.state_dict().items()}
    net.load_state_dict(kept)
    net.train(dropout > 0)
    with torch.no_grad():
        return torch.stack([net(asked) for _ in range(passes)])


def about(value: Array, half: Array) -> Read:
    """Intervals of half widths (n, 2), (n, 1) or (2,) about values (n, 2)."""
    return Read(value, value - half, value + half)


METHODS: dict[str, Learn | None] = {
    "ours": None, "ridge": ridge, "kernel ridge": yardstick, "gp": gp, "npe": npe,
    "ensemble": partial(networks, count=NETWORKS, passes=1), "dropout": partial(networks, count=1, passes=PASSES)}


@dataclass(frozen=True, eq=False)
class Tested:
    """Presses that test, and how they differ from those that teach."""

    age: int  # presses that the untouched frame is older than recorded
    dead: int  # readings
    session: str
    recording: Recording
    presses: Presses
    labels: Labels

    @property
    def key(self) -> dict[str, object]:
        return {"age": self.age, "dead": self.dead, "session": self.session}


def placed(skin: str) -> tuple[Presses, Labels]:
    """Presses of a skin and their places, those of two sessions in the coordinates of the first."""
    return another_session.carbon(skin) if skin in another_session.CARBON else few_labels.placed(skin)


def tested(skin: str, draw: int) -> list[Tested]:
    """What a draw of a skin is tested on."""
    recording, _, _ = recorded(skin)
    presses, labels = placed(skin)
    _, test = split_rows(len(labels.touch), "time", 0)
    now, right = taken(presses, test), labels_of(labels, test)
    gone = np.random.default_rng(draw).choice(now.signal.shape[1], DEAD, replace=False)
    signal, following = now.signal.copy(), now.following.copy()
    signal[:, gone] = following[:, gone] = np.nan
    found = [Tested(0, 0, "first", recording, now, right),
             Tested(0, DEAD, "first", recording, replace(now, signal=signal, following=following), right)]
    if len(presses.rest):
        found.append(Tested(OLD, 0, "first", recording, taken(read_old(recording, presses, test, OLD), test), right))
    if skin in SECOND:
        other, places = placed(SECOND[skin])
        _, test = split_rows(len(places.touch), "time", 0)
        there = recorded(SECOND[skin])[0], taken(other, test), labels_of(places, test)
        found += [Tested(0, 0, session, *there) for session in ("second", TAUGHT)]
    return found


def five_of(skin: str, draw: int) -> tuple[Presses, Labels]:
    """Five presses of the first four fifths of the second session."""
    presses, labels = placed(SECOND[skin])
    early, _ = split_rows(len(labels.touch), "time", 0)
    rows = np.sort(np.random.default_rng(draw).choice(early, FEWEST, replace=False))
    return taken(presses, rows), labels_of(labels, rows)


def ours(skin: str, draw: int, presses: Presses, labels: Labels, asked: Sequence[Tested]) -> list[tuple[Read, Mask]]:
    """Places and flags of what is tested."""
    expectation = expectation_of(read_sensor(REAL / skin / "sensor.toml"))
    reader = press_reader.fit(presses, labels, 0, expectation)
    out = []
    for one in asked:
        now = continued(reader, *five_of(skin, draw)).reader if one.session == TAUGHT else reader
        found = press_reader.read(now, one.presses)
        assert found.place
        out.append((about(found.place.value, found.place.bounds.half_width), found.kinds > 0))
    return out


def theirs(learn: Learn, skin: str, draw: int, presses: Presses, labels: Labels,
           asked: Sequence[Tested]) -> list[tuple[Read, Mask]]:
    """The same, without flags: learnt once for all that the presses alone teach."""
    readings = learn_readings(presses.signal)
    rows = [filled(readings, one.presses.signal) for one in asked]
    out: list[tuple[Read, Mask]] = []
    for five in (False, True):
        now = [row for row, one in zip(rows, asked, strict=True) if (one.session == TAUGHT) is five]
        if not now:
            continue
        signal, place = presses.signal, labels.values
        if five:
            more, there = five_of(skin, draw)
            signal, place = np.vstack([signal, more.signal]), np.vstack([place, there.values])
        found, ends = learn(signal, place, np.vstack(now), draw), np.cumsum([len(row) for row in now])[:-1]
        parts = zip(*(np.split(one, ends) for one in (found.value, found.low, found.high)), strict=True)
        out += [(Read(*part), np.zeros(len(part[0]), bool)) for part in parts]
    return out


def measured(skin: str, count: int, draw: int, method: str) -> list[dict[str, object]]:
    """What the audit says of a method taught by a draw, a row for all that it is tested on."""
    presses, labels = placed(skin)
    first, _ = split_rows(len(labels.touch), "time", 0)
    train = np.sort(np.random.default_rng(1000 + draw).choice(first, count, replace=False))
    begun, learn, asked = time.process_time(), METHODS[method], tested(skin, draw)
    known = taken(presses, train), labels_of(labels, train)
    found = ours(skin, draw, *known, asked) if learn is None else theirs(learn, skin, draw, *known, asked)
    spent = time.process_time() - begun
    return [one.key | scored(one, read, flagged) | {"cpu_s": spent}
            for one, (read, flagged) in zip(asked, found, strict=True)]


def scored(asked: Tested, found: Read, flagged: Mask) -> dict[str, float]:
    """What the audit says of places as read, and of the frames without a flag."""
    right = asked.labels.values
    table = pd.DataFrame({"touch": asked.labels.touch} | {
        f"{axis}0{end}_mm": values[:, k] for k, axis in enumerate("xy")
        for end, values in (("", found.value), ("_lo90", found.low), ("_hi90", found.high))})
    said = evaluate_predictions(table, asked.recording, asked.labels, str(asked.session))["verdict"]
    inside = (found.low <= right) & (right <= found.high)
    outside = np.maximum(found.low - right, 0) + np.maximum(right - found.high, 0)
    return {"distance_mm": said["distance_mm"], "x_in_90": said["outputs"]["x0"]["coverage_90"],
            "y_in_90": said["outputs"]["y0"]["coverage_90"],
            "half_mm": float(np.mean([one["half_width_90"] for one in said["outputs"].values()])),
            "flagged": float(flagged.mean()),
            "unflagged_in_90": np.nan if flagged.all() else float(inside[~flagged].mean(axis=0).min()),
            "holds": float(said["holds"]),
            "interval_score_mm": float(np.mean(found.high - found.low + 2 / (1 - COVERAGE) * outside))}


def rows_of(skin: str, count: int, method: str) -> pd.DataFrame:
    """The rows of a method: means over draws, and the worst."""
    each = pd.DataFrame([row for draw in range(DRAWS) for row in measured(skin, count, draw, method)])
    each["least"] = each[["x_in_90", "y_in_90"]].min(axis=1)
    groups = each.groupby(["age", "dead", "session"], sort=False)
    means = pd.DataFrame(groups.mean()).drop(columns="least")
    means["worst_mm"], means["least_in_90"] = groups["distance_mm"].max(), groups["least"].min()
    return means.reset_index().assign(skin=skin, labels=count, draws=DRAWS, method=method)


def main(methods: Sequence[str]) -> None:
    if not REAL.is_dir():
        print(f"{REAL} is not there; nothing is measured.")
        return
    table = earlier(NAME)
    done = {*zip(table["skin"], table["labels"], table["method"], strict=True)} if len(table) else set()
    for count in LABELS:
        for skin in SKINS:
            for method in methods:
                if (skin, count, method) not in done:
                    one = rows_of(skin, count, method)
                    shown(one)
                    table = written(pd.concat([table, one], ignore_index=True), NAME)


if __name__ == "__main__":
    main(sys.argv[1:] or list(METHODS))
