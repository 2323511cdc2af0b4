"""Networks as TorchScript: one module from the 208 differences to the untouched frame to the outputs in their units."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from surrogate.learners.bayesian_network.ensemble import Networks
from surrogate.learners.bayesian_network.min_max import MinMax
from surrogate.learners.network import FeatureNetworks
from surrogate.learners.signal_features import Directions
from surrogate.learners.trainbr import Trainbr
from surrogate.model.sweep_model import SweepModel
from touchcal.lazy import needed

if TYPE_CHECKING:
    from torch import nn


def network_module(model: SweepModel) -> nn.Module:
    """(n, readings) differences to the untouched frame, V, float64 -> (n, outputs) in the outputs' units.

    ValueError for a method that is no network, or where PyTorch is missing.
    """
    match model.learner:
        case Trainbr(readings, networks):
            return _sequence(_scaled(readings), *_of_networks(networks))
        case FeatureNetworks(directions, networks):
            return _sequence(_features(directions), *_of_networks(networks))
    raise ValueError(f"method '{model.method}' is no network. Export a model of trainbr or network; "
                     "`surrogate predict` reads the others.")


def write(model: SweepModel, path: Path) -> dict[str, str]:
    """Write the network as TorchScript, for torch.jit.load in Python or C++, and return what it takes and gives, its
    extra files inputs.txt and outputs.txt.

    torch calls TorchScript deprecated; its successor, torch.export, writes no file that C++ reads without a compiler.
    """
    needed("torch", "exported networks")
    import torch

    described = {"inputs": f"{len(model.baseline_V)} differences to the untouched frame, V, float64, one frame a row",
                 "outputs": ", ".join(f"{n} ({u})" for n, u in zip(model.names, model.units, strict=True))}
    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        script = torch.jit.trace(network_module(model), torch.ones(2, len(model.baseline_V), dtype=torch.float64))
        torch.jit.save(script, str(path), _extra_files={f"{key}.txt": text for key, text in described.items()})
    return described


def _sequence(*parts: nn.Module) -> nn.Module:
    from torch import nn

    return nn.Sequential(*parts)


def _affine(weight: NDArray[np.floating], bias: NDArray[np.floating]) -> nn.Module:
    """x -> x W' + b, float64."""
    import torch
    from torch import nn

    part = nn.Linear(*weight.shape[::-1], dtype=torch.float64)
    part.weight.data, part.bias.data = torch.from_numpy(np.array(weight)), torch.from_numpy(np.array(bias))
    return part.requires_grad_(False)


def _features(directions: Directions) -> nn.Module:
    """dV -> whitened dV / |dV|, then standardised log |dV|."""
    import torch
    from torch import nn

    class Features(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.along = _affine(directions.axes, -directions.axes @ directions.mean)

        def forward(self, signal_V: torch.Tensor) -> torch.Tensor:
            size = torch.linalg.vector_norm(signal_V, dim=1, keepdim=True)
            return torch.cat([self.along(signal_V / size), (size.log() - directions.log_mean) / directions.log_sd], 1)

    return Features()


def _scaled(scaling: MinMax) -> nn.Module:
    middle = (scaling.lowest + scaling.highest) / 2
    return _affine(np.diag(1 / scaling.half_span), -middle / scaling.half_span)


def _of_networks(networks: Networks) -> list[nn.Module]:
    """All hidden layers side by side, then one output of each, in its unit."""
    from torch import nn

    inner, bias, outer, offset = networks.layers
    outputs, units = bias.shape
    last = np.zeros((outputs, outputs, units))
    last[np.arange(outputs), np.arange(outputs)] = outer
    targets = networks.targets
    return [_affine(inner.reshape(outputs * units, -1), bias.ravel()), nn.Tanh(),
            _affine(last.reshape(outputs, outputs * units), offset),
            _affine(np.diag(targets.half_span), (targets.lowest + targets.highest) / 2)]
