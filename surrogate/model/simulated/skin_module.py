"""A skin for robot simulators: contacts to readings as one differentiable module; imported where PyTorch is there."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from surrogate.data.reading_noise import noise_of, white_noise
from surrogate.forward_map.map_arrays import PROCESSES, converted, signals
from surrogate.model.simulated.touch_map import TouchMap, touch_map
from surrogate.model.sweep_model import SweepModel
from touchcal.arrays import Array

CHUNK = 256  # contacts that a processor works out together, to stay in its cache
NO_FORCE_N = 1e-9  # force that takes the place of none, so that derivatives stay finite


class Skin(nn.Module):
    """Readings of a touched skin, V = V0 + sum of f(x, y, d, F) over its contacts + noise, f a learned forward map.

    Contacts add up: what one changes of the current that reaches another is left out.

    Parameters
    ----------
    model : SweepModel, TouchMap or path
        A model of the method forward of a disc, or its folder.
    untouched_V : (frames, readings), optional
        Untouched frames of your sensor, V: their mean is V0, and readings are noisy as their scatter is, with what
        neighbouring readings share from 8 frames on. Where left out, V0 is the training's.
    noise_V : float, optional
        Standard deviation of independent noise of each reading, V, in place of the scatter; 0 where both are left out.
    turned_rad : (electrodes,), optional
        Angles by which electrodes lie off their places, as `eitsim sensor fit` finds them, rad.
    dtype : torch.dtype
        Precision, also changed by `.double()` and `.float()`.

    Raises
    ------
    ValueError
        For another method, a skin that is no disc, or frames of another number of readings.

    Examples
    --------
    >>> skin = surrogate.Skin("model", noise_V=1e-4)
    >>> contacts = torch.tensor([[[0.02, 0.0, 0.014, 1.0]]])
    >>> skin(contacts).shape
    torch.Size([1, 208])
    """

    untouched_V: Tensor
    noise_root_V: Tensor
    turned_rad: Tensor
    white_V: Tensor
    per_contact: Tensor

    def __init__(self, model: SweepModel | TouchMap | Path | str, untouched_V: ArrayLike | None = None,
                 noise_V: float | None = None, turned_rad: Sequence[float] | Array | None = None,
                 dtype: torch.dtype = torch.float32) -> None:
        super().__init__()
        known = model if isinstance(model, TouchMap) else touch_map(model)
        readings, electrodes = len(known.baseline_V), known.electrodes
        turned = np.zeros(electrodes) if turned_rad is None else np.asarray(turned_rad, float)
        if turned.shape != (electrodes,):
            raise ValueError(f"turned_rad must hold {electrodes} angles, one an electrode, got {turned.shape}.")
        still, noise = known.untouched(turned[None])[0], white_noise(noise_V or 0.0, readings)
        if untouched_V is not None:
            frames = np.atleast_2d(np.asarray(untouched_V, float))
            if frames.shape[1:] != (readings,) or not np.isfinite(frames).all():
                raise ValueError(f"untouched_V must be finite frames (n, {readings}), got {frames.shape}.")
            still = frames.mean(axis=0)
            noise = noise if noise_V is not None else noise_of(frames, known.ring) or noise
        self._arrays, self._bounds = known.arrays, known.bounds
        self._made: tuple[Any, Any] = (None, None)
        for name, values in (("untouched_V", still), ("noise_root_V", noise.root), ("turned_rad", turned),
                             ("white_V", np.array(noise.white_V)), ("per_contact", np.array([1e3, 1e3, 1e3, 1.0]))):
            self.register_buffer(name, torch.tensor(np.ascontiguousarray(values), dtype=torch.float64))
        self.to(dtype)

    def _of_here(self) -> Any:
        """The map's arrays on the device and in the precision of the buffers, processes in double precision: sums of
        large terms of both signs, whose digits float32 has not."""
        where = self.untouched_V.device, self.untouched_V.dtype
        if self._made[0] != where:
            self._made = where, converted(self._arrays, lambda name, values: torch.tensor(
                np.ascontiguousarray(values), device=where[0],
                dtype=None if values.dtype.kind != "f" or name in PROCESSES else where[1]))
        return self._made[1]

    def signal(self, contacts: Tensor) -> Tensor:
        """(..., readings) change of the readings, V, by contacts (..., k, 4); derivatives by them are torch's."""
        touch = (contacts * self.per_contact).reshape(-1, 4)
        there = touch[:, 3] > 0
        force = torch.where(there, touch[:, 3], torch.full_like(touch[:, 3], NO_FORCE_N))
        touch = torch.cat([touch[:, :3], force[:, None]], 1)
        pieces = touch.split(CHUNK) if touch.device.type == "cpu" else [touch]
        found = torch.cat([signals(self._of_here(), torch, one, self.turned_rad.expand(len(one), -1))
                           for one in pieces])
        found = torch.where(there[:, None], found, torch.zeros_like(found))
        return found.reshape(*contacts.shape[:-1], -1).sum(-2)

    def forward(self, contacts: Tensor, noisy: bool = True, generator: torch.Generator | None = None) -> Tensor:
        """Readings (..., readings), V, by contacts (..., k, 4): x_m, y_m, d_m, F_N of k contacts each; one without
        force is none. noisy: whether noise of the sensor is added; generator: its random numbers."""
        found = self.untouched_V + self.signal(contacts)
        if not noisy:
            return found

        def normal(columns: int) -> Tensor:
            return torch.randn((*found.shape[:-1], columns), generator=generator, dtype=found.dtype,
                               device=found.device)

        found = found + self.white_V * normal(found.shape[-1])
        columns = self.noise_root_V.shape[1]
        return found + normal(columns) @ self.noise_root_V.T if columns else found

    def inside(self, contacts: Tensor) -> Tensor:
        """(..., k) whether contacts lie where the map was learned: radius, diameter and force within its bounds."""
        touch = contacts * self.per_contact
        (_, d_lo, f_lo), (reach, d_hi, f_hi) = self._bounds.tolist()
        radius, d, force = torch.hypot(touch[..., 0], touch[..., 1]), touch[..., 2], touch[..., 3]
        return (radius <= reach) & (d >= d_lo) & (d <= d_hi) & (force >= f_lo) & (force <= f_hi)
