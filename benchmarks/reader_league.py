"""Readers of places next to ours, each with the intervals that it gives itself: distance, coverage and width.

Usage: python benchmarks/reader_league.py [methods ...]. Reads the recordings in ../shared/real, which others measured,
and stops where they are not there. Draws of labels are those of few_labels.py; the last fifth in time tests, scored by
what `surrogate audit` says of a table of predictions, flags left out. Adds to results/reader_league.csv the rows that
it lacks, means over `draws`; least_in_90 is the least part of x or y that the 90 % intervals hold in any draw, `holds`
the part of the draws in which the audit's test passes, interval_score_mm the mean of Gneiting and Raftery (2007,
equation 43), which is the width and 20 times what a place lies outside: lower is better. Methods:

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
from dataclasses import dataclass
from functools import partial

import few_labels
import numpy as np
import pandas as pd
import torch
from conditions import earlier, quick, shown, written
from real_skins import REAL, recorded
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize
from torch import Tensor, nn

from eitsim.sensors.labels import labels_of
from eitsim.sensors.sensor_file import read_sensor
from surrogate.model.recorded.reader_evaluation import evaluate_predictions
from surrogate.model.recorded.reader_scores import split_rows
from surrogate.recordings import kernel_ridge, press_reader
from surrogate.recordings.patterns import learn_features
from surrogate.recordings.physics.expectation import expectation_of
from surrogate.recordings.presses import taken
from surrogate.statistics.conformal import COVERAGE, conformal_scale, normal
from surrogate.statistics.gaussian_process import squared_distance
from touchcal.arrays import Array

NAME = "reader_league"
SKINS, LABELS, DRAWS = quick(("skin_plain", "hydrogel"), ("hydrogel",)), quick((20, 100), (20,)), quick(3, 1)
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


def measured(skin: str, count: int, draw: int, method: str) -> dict[str, float]:
    """What the audit says of a method taught by a draw."""
    recording, _, _ = recorded(skin)
    presses, labels = few_labels.placed(skin)
    first, test = split_rows(len(labels.touch), "time", 0)
    train = np.sort(np.random.default_rng(1000 + draw).choice(first, count, replace=False))
    begun, learn = time.process_time(), METHODS[method]
    if learn is None:
        expectation = expectation_of(read_sensor(REAL / skin / "sensor.toml"))
        reader = press_reader.fit(taken(presses, train), labels_of(labels, train), 0, expectation)
        place = press_reader.read(reader, taken(presses, test)).place
        assert place
        found = about(place.value, place.bounds.half_width)
    else:
        found = learn(presses.signal[train], labels.values[train], presses.signal[test], draw)
    spent = time.process_time() - begun
    table = pd.DataFrame({"touch": labels.touch[test]} | {
        f"{axis}0{end}_mm": values[:, k] for k, axis in enumerate("xy")
        for end, values in (("", found.value), ("_lo90", found.low), ("_hi90", found.high))})
    right = labels_of(labels, test)
    said = evaluate_predictions(table, recording, right, skin)["verdict"]
    outside = np.maximum(found.low - right.values, 0) + np.maximum(right.values - found.high, 0)
    return {"distance_mm": said["distance_mm"], "x_in_90": said["outputs"]["x0"]["coverage_90"],
            "y_in_90": said["outputs"]["y0"]["coverage_90"],
            "half_mm": float(np.mean([one["half_width_90"] for one in said["outputs"].values()])),
            "holds": float(said["holds"]), "cpu_s": spent,
            "interval_score_mm": float(np.mean(found.high - found.low + 2 / (1 - COVERAGE) * outside))}


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
                    each = pd.DataFrame([measured(skin, count, draw, method) for draw in range(DRAWS)])
                    row = {"skin": skin, "labels": count, "draws": DRAWS, "method": method} | each.mean().to_dict()
                    one = pd.DataFrame([row | {"least_in_90": each[["x_in_90", "y_in_90"]].min(axis=None)}])
                    shown(one)
                    table = written(pd.concat([table, one], ignore_index=True), NAME)


if __name__ == "__main__":
    main(sys.argv[1:] or list(METHODS))
