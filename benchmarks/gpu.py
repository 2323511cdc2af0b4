"""What a GPU would save: training of the paper's networks, and solutions of many skins on one mesh together.

    python benchmarks/gpu.py SWEEP

`training` trains trainbr for all eight outputs on 70 % of SWEEP to its own 1,000 steps, from STARTS, once on all rows
and once on those within REACH_MM of the centre, with the dense algebra of each step on the GPU, and scores on the rows
it has not seen, without noise; step_s is wall time of a step, processor_step_s that of the first steps by `surrogate
train`'s own algebra on one thread of the same machine. `solutions` factorises BATCH skins at once as dense matrices,
float64, and compares time and readings with one sparse elimination after another, which is what `eitsim` does. Neither
is part of the toolkit: nothing needs a GPU, and without one this says so and writes nothing. Writes
results/gpu_training.csv and results/gpu_solutions.csv.
"""

import argparse
import itertools
import math
import time
from collections.abc import Iterator
from unittest.mock import patch

import numpy as np
import torch
from conditions import quick, shown, written
from faithful import PAPER, REACH_MM, ROWS, SEED
from torch import Tensor

from eitsim.electrics.cem.assembly import dissection, impedance, quadrature_points, weights
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.scene.scene import Body, Electrodes
from surrogate.data import outputs
from surrogate.data.samples import SweepSamples, read_samples, split, take
from surrogate.learners.bayesian_network import bayesian_regularisation, laplace, layer
from surrogate.learners.bayesian_network.bayesian_regularisation import Options, Training
from surrogate.learners.bayesian_network.laplace import Curvature
from surrogate.learners.bayesian_network.min_max import min_max, scaled, unscaled
from touchcal.arrays import Array

DEVICE = "cuda"
STARTS, EPOCHS, TIMED_STEPS = quick((1, 2, 3), (1,)), quick(1000, 5), 3
# skins solved together on meshes of each level
BATCH = quick({1: 256, 2: 32}, {1: 8})
# conductance of the skins: log-normal about one value, of this spread
CONDUCTANCE_S, SPREAD = 1e-3, 0.3


def curvature(w: Array, x: Array) -> Curvature:
    """As `laplace.curvature`, whole, on the device."""
    net, at = layer.layers(w, x.shape[1]), torch.from_numpy(x).to(DEVICE)
    inner, bias, outer = (torch.from_numpy(one).to(DEVICE) for one in (net.inner, net.bias, net.outer))
    hidden = torch.tanh(at @ inner.T + bias)
    slope = outer * (1 - hidden**2)
    jacobian = torch.cat([(slope[:, :, None] * at[:, None, :]).flatten(1), slope, hidden, at.new_ones(len(at), 1)], 1)
    gram = jacobian @ jacobian.T if len(x) < len(w) else jacobian.T @ jacobian
    return Curvature(gram, len(x), len(w))  # pyright: ignore[reportArgumentType]


def factor(of: Curvature, beta: float, shift: float) -> Tensor:
    """As `laplace.factor`."""
    matrix = beta * torch.as_tensor(of.gram)
    matrix.diagonal().add_(max(shift, 1e-14 * float(matrix.diagonal().mean())))
    return torch.linalg.cholesky(matrix)


def solve(lower: Tensor, right: Array) -> Array:
    """As `laplace.solve`."""
    return torch.cholesky_solve(torch.from_numpy(right).to(DEVICE)[:, None], lower)[:, 0].cpu().numpy()


def effective_parameters(of: Curvature, alpha: float, beta: float) -> tuple[float, float]:
    """As `laplace.effective_parameters`."""
    lower = factor(of, beta, alpha)
    inverse = torch.linalg.solve_triangular(lower, torch.eye(len(lower), dtype=lower.dtype, device=lower.device),
                                            upper=False)
    lost = alpha * float((inverse**2).sum())
    return (of.rows - lost, lost) if of.dual else (of.count - lost, of.rows - of.count + lost)


def log_evidence(of: Curvature, alpha: float, beta: float, cost: float) -> float:
    """As `laplace.log_evidence`."""
    n, p = of.rows, of.count
    log_det = 2 * float(factor(of, beta, alpha).diagonal().log().sum()) + max(p - n, 0) * math.log(alpha)
    return -cost - 0.5 * log_det + 0.5 * p * math.log(alpha) + 0.5 * n * math.log(beta)


@patch.multiple(bayesian_regularisation, curvature=curvature, factor=factor, solve=solve)
@patch.multiple(laplace, log_evidence=log_evidence, effective_parameters=effective_parameters)
def on_device(x: Array, y: Array, seed: int, options: Options) -> tuple[Array, Training]:
    """`bayesian_regularisation.train` with the algebra above."""
    return bayesian_regularisation.train(x, y, seed, options)


def training(samples: SweepSamples, region: str, start: int) -> Iterator[dict[str, object]]:
    """One row an output."""
    part = split(samples.group, SEED)
    train, test = take(samples, part == "train"), take(samples, part == "test")
    readings = min_max(train.signal_V)
    x, unseen = (scaled(readings, rows.signal_V) for rows in (train, test))
    for name in PAPER:
        column = outputs.NAMES.index(name)
        targets = min_max(train.target[:, column:column + 1])
        y = scaled(targets, train.target[:, column:column + 1])[:, 0].copy()
        steps = timed_steps(x, y)
        begun = time.perf_counter()
        w, told = on_device(x, y, start, Options(epochs=EPOCHS))
        took = time.perf_counter() - begun
        value = [unscaled(targets, layer.output(w, rows)[:, None])[:, 0] for rows in (x, unseen)]
        error = [found - rows.target[:, column] for found, rows in zip(value, (train, test), strict=True)]
        rmse = float(np.sqrt(np.mean(error[1]**2)))
        yield {"start": start, "region": region, "output": name, "unit": outputs.of(name).unit, "rmse": rmse,
               "r2": 1 - float(np.mean(error[1]**2)) / float(np.var(test.target[:, column])),
               "train_rmse": float(np.sqrt(np.mean(error[0]**2))), "paper_rmse": PAPER[name],
               "over_paper": rmse / PAPER[name], "epochs": told.epochs, "stop": told.stop, "gamma": told.gamma,
               "parameters": len(w), "collapses": told.collapses, "rows": len(train), "scored_rows": len(test),
               "wall_s": took, "step_s": took / told.epochs, "processor_step_s": steps,
               "device": torch.cuda.get_device_name()}


def timed_steps(x: Array, y: Array) -> float:
    """Wall time of a step on the processor, s."""
    begun = time.perf_counter()
    told = bayesian_regularisation.train(x, y, SEED, Options(epochs=TIMED_STEPS))[1]
    return (time.perf_counter() - begun) / told.epochs


def solutions(level: int, batch: int) -> dict[str, object]:
    """Impedance matrices of random skins on one mesh, together and one after another."""
    body, electrodes = Body(), Electrodes()
    angles, electrode = rim_angles(body, electrodes, level)
    radii = np.linspace(0, body.radius_m, 8 * level + 1)
    mesh = ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, electrodes.count)
    order, z = dissection(mesh), electrodes.contact_impedance_Ohm_m
    points, rng = quadrature_points(mesh).shape[:2], np.random.default_rng(SEED)
    skins = CONDUCTANCE_S * np.exp(SPREAD * rng.normal(size=(batch, points[0], 1)) * np.ones((1, 1, points[1])))
    impedance(mesh, skins[0], z, order=order)
    begun = time.perf_counter()
    alone = np.array([impedance(mesh, skin, z, order=order) for skin in skins])
    alone_s = (time.perf_counter() - begun) / batch
    given = torch.from_numpy(np.array([weights(mesh, skin, z) for skin in skins]))
    places = pairs(mesh)
    together(given, places, mesh.count)
    begun = time.perf_counter()
    found = together(given, places, mesh.count)
    found_s = (time.perf_counter() - begun) / batch
    return {"elements": len(mesh.cells), "unknowns": len(mesh.nodes_m) + mesh.count, "skins": batch,
            "elimination_s": alone_s, "device_s": found_s, "faster": alone_s / found_s,
            "apart": float(np.linalg.norm(found - alone) / np.linalg.norm(alone)),
            "device": torch.cuda.get_device_name()}


def pairs(mesh) -> tuple[Tensor, Tensor]:
    """Unknowns at both ends of every weight."""
    ends = []
    for block in (mesh.cells, np.column_stack([mesh.under, len(mesh.nodes_m) + mesh.electrode])):
        i, j = np.triu_indices(block.shape[1], 1)
        ends.append(np.stack([block[:, i].ravel(), block[:, j].ravel()]))
    first, second = np.concatenate(ends, axis=1)
    return torch.from_numpy(first).to(DEVICE), torch.from_numpy(second).to(DEVICE)


def together(given: Tensor, places: tuple[Tensor, Tensor], count: int) -> np.ndarray:
    """(skins, count, count) impedance matrices of weights (skins, pairs), the last electrode earthed, then centred."""
    first, second = places
    size = int(max(first.max(), second.max())) + 1
    w = given.to(DEVICE)
    flat = torch.zeros(len(w), size * size, dtype=w.dtype, device=w.device)
    for i, j, sign in ((first, second, -1.0), (second, first, -1.0), (first, first, 1.0), (second, second, 1.0)):
        flat.index_add_(1, i * size + j, w, alpha=sign)
    matrix = flat.reshape(len(w), size, size)[:, :-1, :-1]
    lower = torch.linalg.cholesky(matrix)
    currents = torch.zeros(size - 1, count, dtype=w.dtype, device=w.device)
    currents[size - count:, :count - 1] = torch.eye(count - 1, dtype=w.dtype, device=w.device)
    currents[size - count:, :] -= 1 / count
    found = torch.cholesky_solve(currents.expand(len(w), -1, -1), lower)[:, size - count:]
    found = torch.cat([found, torch.zeros_like(found[:, :1])], dim=1)
    return (found - found.mean(dim=1, keepdim=True)).cpu().numpy()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep", help="folder of `eitsim sweep` of the paper's design")
    given = parser.parse_args()
    if not torch.cuda.is_available():
        raise SystemExit("no GPU is at hand, or torch was built without CUDA; nothing in the toolkit needs one.")
    shown(written([solutions(*one) for one in BATCH.items()], "gpu_solutions"))
    samples = read_samples(given.sweep)
    samples = take(samples, np.arange(min(len(samples), ROWS)))
    distance = np.hypot(*samples.target[:, :2].T)
    rows: list[dict[str, object]] = []
    for start, (region, reach) in itertools.product(STARTS, REACH_MM.items()):
        rows += training(take(samples, distance <= reach), region, start)
        shown(written(rows, "gpu_training"))


if __name__ == "__main__":
    main()
