"""An ensemble of small networks, each trained without one block of rows.

All members train as one batched model. A row is held out by the members of its block, so the ensemble that reads new
signals also says what it does on rows that it did not see.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import erf

from touchcal.arrays import Array, Index

if TYPE_CHECKING:
    import torch

HIDDEN = (256, 256, 128)
MEMBERS = 1  # without each block
EPOCHS, MOST_STEPS, BATCH = 120, 1000, 128
RATE, DECAY, DROPOUT, NOISE = 4e-3, 0.05, 0.1, 0.1  # of AdamW; of the standardised inputs
SMOOTH = 1e-4  # square of the distance, over the spread of the targets, below which the loss is quadratic
POOL = 1 << 21  # random numbers drawn once, of which each step takes a run from a random place on


@dataclass(frozen=True, eq=False)
class Layer:
    """One affine map of each member."""

    weight: Array  # (members, in, out)
    bias: Array  # (members, 1, out)


@dataclass(frozen=True, eq=False)
class Networks:
    """Members h -> W gelu(... gelu(W0 f + b0) ...) + b of standardised inputs f, targets standardised."""

    layers: tuple[Layer, ...]
    mean: Array  # (k,) of the targets
    spread: float

    def read_each(self, inputs: Array) -> Array:
        """(members, n, k) targets of inputs (n, q) by each member."""
        values = inputs.astype(self.layers[0].weight.dtype)[None]
        for number, layer in enumerate(self.layers):
            values = (_gelu(values) if number else values) @ layer.weight + layer.bias
        return values * self.spread + self.mean


def fit(inputs: Array, target: Array, blocks: Index, seed: int, epochs: int = EPOCHS) -> tuple[Networks, Array]:
    """Networks of inputs (n, q) and targets (n, k); and (n, k) what the members of its block say of each row."""
    names = np.unique(blocks)
    mean, spread = target.mean(axis=0), float(target.std(axis=0).mean()) or 1.0
    without = np.repeat(names, MEMBERS)
    layers = _trained(inputs, (target - mean) / spread, [np.flatnonzero(blocks != b) for b in without], seed, epochs)
    networks = Networks(layers, mean, spread)
    return networks, held_out(networks, inputs, blocks)


def schedule(rows: int, epochs: int) -> tuple[int, int, int]:
    """Rows of a batch, batches of an epoch, and epochs of a member with these rows: MOST_STEPS batches at most."""
    batch = min(BATCH, max(16, rows // 8), rows)
    each = rows // batch
    return batch, each, max(1, min(epochs, MOST_STEPS // each))


def held_out(networks: Networks, inputs: Array, blocks: Index) -> Array:
    """(n, k) targets of inputs (n, q) by the members that were trained without the block of each row."""
    each, without = networks.read_each(inputs), np.repeat(np.unique(blocks), MEMBERS)
    return np.stack([each[without == block, row].mean(axis=0) for row, block in enumerate(blocks)])


def _gelu(x: Array) -> Array:
    return 0.5 * x * (1 + erf(x / np.sqrt(2, dtype=x.dtype)))


def _trained(inputs: Array, target: Array, rows: list[Index], seed: int, epochs: int) -> tuple[Layer, ...]:
    """Least mean distance, smoothed near zero, under noise of the inputs and dropout; AdamW with one cycle."""
    import torch

    fewest = min(map(len, rows))
    batch, each, epochs = schedule(fewest, epochs)
    chance = torch.Generator().manual_seed(seed)
    x, y = torch.from_numpy(inputs).float(), torch.from_numpy(target).float()
    layers = _drawn(len(rows), (x.shape[1], *HIDDEN, y.shape[1]), chance)
    parameters = [part for layer in layers for part in layer]
    descent = torch.optim.AdamW(parameters, RATE, weight_decay=DECAY, fused=True)
    cycle = torch.optim.lr_scheduler.OneCycleLR(descent, RATE, total_steps=epochs * each)
    known = [torch.from_numpy(one) for one in rows]
    noise = NOISE * torch.randn(POOL, generator=chance)
    kept = (torch.rand(POOL, generator=chance) >= DROPOUT).float() / (1 - DROPOUT)
    for _ in range(epochs):
        order = torch.stack([one[torch.randperm(len(one), generator=chance)[:fewest]] for one in known])
        for step in range(each):
            taken = order[:, step * batch:(step + 1) * batch]
            seen = x[taken]
            found = _run(layers, seen + _some(noise, seen.shape, chance), kept, chance)
            loss = ((found - y[taken]).square().sum(dim=2) + SMOOTH).sqrt().mean(dim=1).sum()
            descent.zero_grad()
            loss.backward()
            descent.step()
            cycle.step()
    return tuple(Layer(weight.detach().numpy(), bias.detach().numpy()) for weight, bias in layers)


def _drawn(members: int, sizes: tuple[int, ...], chance: torch.Generator) -> list[tuple[torch.Tensor, torch.Tensor]]:
    import torch

    return [((2 * torch.rand(members, a, b, generator=chance) - 1).div(a**0.5).requires_grad_(),
             (2 * torch.rand(members, 1, b, generator=chance) - 1).div(a**0.5).requires_grad_())
            for a, b in pairwise(sizes)]


def _some(pool: torch.Tensor, shape: torch.Size, chance: torch.Generator) -> torch.Tensor:
    """A run of a pool of random numbers, of a shape; the whole pool, again and again, where that is larger."""
    import torch

    size = shape.numel()
    if size >= len(pool):
        return pool.repeat(-(-size // len(pool)))[:size].view(shape)
    start = int(torch.randint(len(pool) - size, (1,), generator=chance))
    return pool[start:start + size].view(shape)


def _run(layers: list[tuple[torch.Tensor, torch.Tensor]], x: torch.Tensor, kept: torch.Tensor,
         chance: torch.Generator) -> torch.Tensor:
    import torch
    from torch.nn.functional import gelu

    for number, (weight, bias) in enumerate(layers):
        if number:
            x = gelu(x) * _some(kept, x.shape, chance)
        x = torch.baddbmm(bias, x, weight)
    return x
