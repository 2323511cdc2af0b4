"""An endless data set: touches, materials and instruments are drawn block by block, each block from its own seed."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from eitsim.scene.scene import Scene
from eitsim.sweeps.design.distributions import Distribution, distribution_of
from eitsim.sweeps.measurement.row_instruments import CONTACTS, LEVELS, measured_by_rows
from touchcal.arrays import Array
from touchcal.document import is_number
from touchcal.errors import unknown_key

TOUCH = ("diameter_mm", "force_N")
STEP = 1e-4  # part of a diameter, or of a force, over which derivatives are differences
_DOMAIN = 0x6672616D  # keeps these draws separate from those of designs, which may have the same seed


class TouchSignals(Protocol):
    """What frames ask of a map from touches to signals, as `surrogate.touch_map` makes one."""

    @property
    def radius_mm(self) -> float:
        """Radius of the disc, mm."""
        ...

    @property
    def reach_mm(self) -> float:
        """Largest distance from the disc's centre for which the map was learned, mm."""
        ...

    @property
    def electrodes(self) -> int:
        """How many electrodes."""
        ...

    @property
    def materials(self) -> int:
        """States of the material, standard normal ones."""
        ...

    @property
    def usual(self) -> Mapping[str, Any]:
        """Laws of TOUCH for which the map was learned."""
        ...

    def signals(self, touch: Array, turned: Array | None = None, material: Array | None = None) -> Array:
        """(n, readings) V by touches (n, 4) in mm and N, of electrodes that lie angles (n, electrodes), rad, off."""
        ...

    def untouched(self, turned: Array) -> Array:
        """(n, readings) V of the untouched skin with electrodes that lie angles (n, electrodes), rad, off."""
        ...

    def by_contact(self, sensor: Scene) -> Array:
        """(readings, electrodes) derivatives of untouched readings by logarithms of the contact impedances, V."""
        ...


@dataclass(frozen=True, eq=False)
class Frames:
    """An endless sequence of blocks of rows; block k depends on the seed and k alone."""

    touch_map: TouchSignals
    laws: Mapping[str, Distribution | float]  # of TOUCH and LEVELS
    by_contact_V: Array | None  # (readings, electrodes), where contacts are drawn
    seed: int
    rows: int  # of a block
    within_mm: float
    derivatives: bool
    dtype: str
    first: int = 0  # block with which it begins

    def __iter__(self) -> Iterator[dict[str, Array]]:
        """Blocks from `first` on, without end."""
        k = self.first
        while True:
            yield self.block(k)
            k += 1

    def starting_at(self, block: int) -> Frames:
        """The same from another block on, as to go on where a run ended."""
        return replace(self, first=block)

    def torch_dataset(self) -> Any:
        """A `torch.utils.data.IterableDataset` of the same blocks, shared among a DataLoader's workers; give the
        loader `batch_size=None`. ValueError without PyTorch."""
        from touchcal.lazy import needed

        needed("torch", "data sets of PyTorch")
        from eitsim.sweeps.endless.torch_frames import TorchFrames

        return TorchFrames(self)

    def block(self, k: int) -> dict[str, Array]:
        """Block k of so many rows: `touch` (rows, 4) x_mm, y_mm, d_mm, F_N; `signal_V` and `untouched_V` (rows,
        readings), V; `noise_V` (rows,) of one reading of one frame; where drawn, `material` (rows, states) and `turned`
        (rows, electrodes), rad; with derivatives, `by_touch` (rows, readings, 4), V/mm and V/N, of the clean signal."""
        def stream(term: str) -> np.random.Generator:
            return np.random.default_rng(np.random.SeedSequence(
                self.seed, spawn_key=(_DOMAIN, k, zlib.crc32(term.encode()))))

        skin, n = self.touch_map, self.rows
        drawn = {name: _values(law, stream(f"level {name}"), n) for name, law in self.laws.items()}
        touch = self._touches(drawn, stream("place"))
        made: dict[str, Array] = {"touch": touch}
        material = turned = None
        if skin.materials:
            made["material"] = material = stream("material").standard_normal((n, skin.materials))
        if "position_mm" in drawn:
            off_mm = drawn["position_mm"][:, None] * stream("position").standard_normal((n, skin.electrodes))
            made["turned"] = turned = off_mm / skin.radius_mm
        still = skin.untouched(np.zeros((1, skin.electrodes)) if turned is None else turned)
        signal = skin.signals(touch, turned, material)
        levels = {name: drawn[name] for name in LEVELS if name in drawn}
        still = np.broadcast_to(still, signal.shape)
        found = measured_by_rows(levels, signal + still, still, stream, self.by_contact_V)
        made |= {"signal_V": found.touched_V - found.untouched_V, "untouched_V": found.untouched_V,
                 "noise_V": found.noise_V}
        if self.derivatives:
            made["by_touch"] = _by_touch(skin, touch, turned, material)
        return {name: np.ascontiguousarray(values, self.dtype) for name, values in made.items()}

    def _touches(self, drawn: Mapping[str, Array], generator: np.random.Generator) -> Array:
        d, force = (drawn[name] for name in TOUCH)
        reach = np.minimum(self.within_mm, self.touch_map.radius_mm - d / 2)
        radius = reach * np.sqrt(generator.random(self.rows))
        angle = 2 * np.pi * generator.random(self.rows)
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), d, force])


def _values(law: Distribution | float, generator: np.random.Generator, n: int) -> Array:
    if not isinstance(law, Distribution):
        return np.full(n, law)
    assert law.quantile is not None
    return np.fromiter(map(law.quantile, generator.random(n).tolist()), float, n)


def _by_touch(skin: TouchSignals, touch: Array, turned: Array | None, material: Array | None) -> Array:
    columns = []
    for q in range(4):
        step = np.zeros_like(touch)
        step[:, q] = STEP * touch[:, 2 if q < 3 else 3]
        there, back = (skin.signals(touch + way * step, turned, material) for way in (1, -1))
        columns.append((there - back) / (2 * step[:, q, None]))
    return np.stack(columns, axis=2)


def frames(touch_map: TouchSignals, *, seed: int = 0, rows: int = 1024, within_mm: float | None = None,
           sensor: Scene | None = None, derivatives: bool = False, dtype: str = "float64", **laws: Any) -> Frames:
    """Draw rows (touch, signal) without end: dV = f(touch, material, electrodes) of a learned map f, each row read by
    an instrument of its own.

    Parameters
    ----------
    touch_map : TouchSignals
        The map, from `surrogate.touch_map(model)`.
    seed : int
        Seed of all draws. Block k depends on it and on k alone.
    rows : int
        Rows of a block.
    within_mm : float, optional
        Largest distance of touches from the centre, mm; where left out, that for which the map was learned. Places are
        uniform over that disc, as far as the punch fits.
    sensor : Scene, optional
        The sensor, for `contact_spread` and `contact_impedance`.
    derivatives : bool
        Whether blocks have `by_touch`, the derivatives of the clean signals; they take eight more evaluations.
    dtype : "float64" or "float32"
        Of the arrays in blocks.
    **laws
        What is drawn for each row: `diameter_mm`, `force_N`, by default as in the map's training, and levels of the
        instrument: `snr_db` or `noise_V`, `gain`, `offset_V`, `contact_spread`, `contact_impedance`, `position_mm`,
        `drift`, `drift_channel`, `dead`. Each is a number, a range [lowest, highest] or a law as in a design, as
        {"dist": "loguniform", "lo": 1e-4, "hi": 1e-2}.

    Returns
    -------
    Frames
        Iterate it for blocks, dictionaries of arrays; `block(k)`, `starting_at(k)` and `torch_dataset()` serve runs
        that go on and PyTorch.

    Raises
    ------
    ValueError
        For an unknown key, a value that is no number or law, a place, punch or force for which the map was not
        learned, or contacts without `sensor`.

    Examples
    --------
    >>> import eitsim, surrogate
    >>> skin = surrogate.touch_map("model")
    >>> blocks = eitsim.frames(skin, seed=1, snr_db=[60, 90], position_mm=0.3)
    >>> next(iter(blocks))["signal_V"].shape
    (1024, 208)
    """
    known = (*TOUCH, *LEVELS)
    if unknown := [name for name in laws if name not in known]:
        raise ValueError(unknown_key(unknown[0], known, "frames"))
    if not (is_number(rows) and rows >= 1 and rows == int(rows)):
        raise ValueError(f"rows must be a whole number from 1, got {rows!r}.")
    if dtype not in ("float64", "float32"):
        raise ValueError(f"dtype must be float64 or float32, got {dtype!r}.")
    found = {name: _law(name, value, touch_map) for name, value in ({**touch_map.usual, **laws}).items()}
    contacts = [name for name in CONTACTS if name in found]
    if contacts and sensor is None:
        raise ValueError(f"{contacts[0]} needs the sensor's electrodes; give sensor=eitsim.read_scene(FILE), or "
                         "sensor=eitsim.Scene() for the usual one.")
    reach = touch_map.reach_mm if within_mm is None else within_mm
    if not 0 <= reach <= touch_map.reach_mm * (1 + 1e-9):
        raise ValueError(f"within_mm must be from 0 to {touch_map.reach_mm:.4g}, for which the map was learned, got "
                         f"{reach:g}.")
    by_contact = touch_map.by_contact(sensor) if contacts and sensor is not None else None
    return Frames(touch_map, found, by_contact, seed, int(rows), float(reach), derivatives, dtype)


def _law(name: str, value: Any, touch_map: TouchSignals) -> Distribution | float:
    law = distribution_of(name, value)
    if law is None and not is_number(value):
        raise ValueError(f"{name} must be a number, a range [lowest, highest] or a law as in a design, got {value!r}.")
    if law is not None and law.quantile is None:
        raise ValueError(f"{name} must be drawn by chance, got {value!r}; give {{\"choice\": [...]}}.")
    low, high = (value, value) if law is None else law.ends
    if name in TOUCH:
        known = distribution_of(name, touch_map.usual[name])
        least, most = known.ends if known is not None else (touch_map.usual[name],) * 2
        if not least * (1 - 1e-9) <= low <= high <= most * (1 + 1e-9):
            raise ValueError(f"{name} must be from {least:.4g} to {most:.4g}, for which the map was learned, got "
                             f"{value}.")
    elif name != "snr_db" and not low >= 0:
        raise ValueError(f"{name} is the size of an error, from 0, got {value}.")
    elif name == "dead" and high > 1:
        raise ValueError(f"dead is a probability, from 0 to 1, got {value}.")
    return float(value) if law is None else law
