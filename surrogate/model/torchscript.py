"""Networks as TorchScript: one module from the 208 differences to the untouched frame to the outputs in their units."""

import warnings
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from surrogate.learners.bayesian_network.ensemble import Networks
from surrogate.learners.bayesian_network.min_max import MinMax
from surrogate.learners.network import FeatureNetworks
from surrogate.learners.signal_features import Directions
from surrogate.learners.trainbr import Trainbr
from surrogate.model.model import Model


class _Affine(nn.Module):
    """x -> x W' + b."""

    weight: Tensor
    bias: Tensor

    def __init__(self, weight: NDArray[np.floating], bias: NDArray[np.floating]) -> None:
        super().__init__()
        self.register_buffer("weight", torch.from_numpy(np.array(weight)))
        self.register_buffer("bias", torch.from_numpy(np.array(bias)))

    def forward(self, x: Tensor) -> Tensor:
        return x @ self.weight.T + self.bias


class _Features(nn.Module):
    """dV -> whitened dV / |dV|, then standardised log |dV|."""

    mean: Tensor

    def __init__(self, directions: Directions) -> None:
        super().__init__()
        self.register_buffer("mean", torch.from_numpy(np.array(directions.mean)))
        self.along = _Affine(directions.axes, np.zeros(len(directions.axes)))
        self.log_mean, self.log_sd = directions.log_mean, directions.log_sd

    def forward(self, signal_V: Tensor) -> Tensor:
        size = torch.linalg.vector_norm(signal_V, dim=1, keepdim=True)
        return torch.cat([self.along(signal_V / size - self.mean), (size.log() - self.log_mean) / self.log_sd], dim=1)


def network_module(model: Model) -> nn.Module:
    """(n, readings) differences to the untouched frame, V, float64 -> (n, outputs) in the outputs' units.

    ValueError for a method that is no network.
    """
    match model.learner:
        case Trainbr(readings, networks):
            return nn.Sequential(_scaled(readings), *_of_networks(networks))
        case FeatureNetworks(directions, networks):
            return nn.Sequential(_Features(directions), *_of_networks(networks))
    raise ValueError(f"method '{model.method}' is no network. Export a model of trainbr or network; "
                     "`surrogate predict` reads the others.")


def write(model: Model, path: Path) -> dict[str, str]:
    """Write the network as TorchScript, for torch.jit.load in Python or C++, and return what it takes and gives, its
    extra files inputs.txt and outputs.txt.

    torch calls TorchScript deprecated; its successor, torch.export, writes no file that C++ reads without a compiler.
    """
    described = {"inputs": f"{len(model.baseline_V)} differences to the untouched frame, V, float64, one frame a row",
                 "outputs": ", ".join(f"{n} ({u})" for n, u in zip(model.names, model.units, strict=True))}
    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        script = torch.jit.trace(network_module(model), torch.ones(2, len(model.baseline_V), dtype=torch.float64))
        torch.jit.save(script, str(path), _extra_files={f"{key}.txt": text for key, text in described.items()})
    return described


def _scaled(scaling: MinMax) -> _Affine:
    middle = (scaling.lowest + scaling.highest) / 2
    return _Affine(np.diag(1 / scaling.half_span), -middle / scaling.half_span)


def _unscaled(scaling: MinMax) -> _Affine:
    return _Affine(np.diag(scaling.half_span), (scaling.lowest + scaling.highest) / 2)


def _of_networks(networks: Networks) -> list[nn.Module]:
    """All hidden layers side by side, then one output of each."""
    inner, bias, outer, offset = networks.layers
    outputs, units = bias.shape
    last = np.zeros((outputs, outputs, units))
    last[np.arange(outputs), np.arange(outputs)] = outer
    return [_Affine(inner.reshape(outputs * units, -1), bias.ravel()), nn.Tanh(),
            _Affine(last.reshape(outputs, outputs * units), offset), _unscaled(networks.targets)]
