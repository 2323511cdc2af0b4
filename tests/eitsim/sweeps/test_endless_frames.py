"""An endless data set: the same blocks by seed and number, laws of a design, terms that do not move each other."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import eitsim
from eitsim.sweeps.measurement.row_instruments import LEVELS
from touchcal.arrays import Array


class Flat:
    """A map whose signal is x + 10 F in each of 8 readings of 4 electrodes, and whose readings are 1 V."""

    radius_mm, reach_mm, electrodes, materials = 100.0, 50.0, 4, 0
    usual: Mapping[str, Any] = {"diameter_mm": {"choice": [10, 14]}, "force_N": [0.1, 2.0]}

    def signals(self, touch: Array, turned: Array | None = None, material: Array | None = None) -> Array:
        off = 0 if turned is None else turned.sum(axis=1, keepdims=True)
        return np.repeat(touch[:, :1] + 10 * touch[:, 3:], 8, axis=1) + off

    def untouched(self, turned: Array) -> Array:
        return np.ones((len(turned), 8))

    def by_contact(self, sensor: eitsim.Scene) -> Array:
        return np.eye(8)[:, :4]


ALL = {name: [1e-3, 2e-3] for name in LEVELS} | {"snr_db": [40, 80], "dead": 0.1}
SKIN = Flat()


def test_blocks_depend_on_seed_and_number_alone() -> None:
    made = eitsim.frames(SKIN, seed=3, rows=20, sensor=eitsim.Scene(), **ALL)
    third = list(itertools.islice(made, 3))[2]
    again = next(iter(eitsim.frames(SKIN, seed=3, rows=20, sensor=eitsim.Scene(), **ALL).starting_at(2)))
    assert all(np.array_equal(third[name], again[name], equal_nan=True) for name in third)
    other = eitsim.frames(SKIN, seed=4, rows=20).block(2)
    assert not np.any(other["touch"][:, :2] == third["touch"][:, :2])


@pytest.mark.parametrize("name", [name for name in LEVELS if name != "dead"])
def test_a_term_changes_frames_as_much_as_it_says_and_no_other(name: str) -> None:
    level = 40.0 if name == "snr_db" else 0.01
    clean = eitsim.frames(SKIN, rows=4000).block(0)
    rough = eitsim.frames(SKIN, rows=4000, sensor=eitsim.Scene(), **{name: level}).block(0)
    assert np.array_equal(clean["touch"], rough["touch"])
    touched = {which: one["signal_V"] + one["untouched_V"] for which, one in (("clean", clean), ("rough", rough))}
    off = touched["rough"] - touched["clean"]
    still = np.std(rough["untouched_V"] - clean["untouched_V"])
    if name in ("gain", "drift", "drift_channel"):
        off /= touched["clean"]
    if name.startswith("contact"):
        off, still = off[:, :4], still * np.sqrt(2)
    sd = 4 ** 0.5 * 0.01 / 100 if name == "position_mm" else 0.01
    assert np.std(off) == pytest.approx(sd, rel=0.05)
    assert still == pytest.approx(0 if name in ("contact_impedance", "position_mm", "drift", "drift_channel") else 0.01,
                                  rel=0.05)


def test_levels_and_touches_follow_their_laws() -> None:
    block = eitsim.frames(SKIN, rows=5000, snr_db={"choice": [40, 60]}, within_mm=30, dtype="float32",
                          force_N={"dist": "loguniform", "lo": 0.1, "hi": 2}).block(0)
    assert {one.dtype for one in block.values()} == {np.dtype("float32")}
    assert set(np.round(np.log10(block["noise_V"]), 3)) == {-2.0, -3.0}
    x, y, d, force = block["touch"].T
    assert np.quantile(np.hypot(x, y), [0.25, 1]) == pytest.approx([15, 30], rel=0.03)
    assert set(d) == {10, 14}
    assert np.median(force) == pytest.approx(np.sqrt(0.2), rel=0.05)


def test_dead_readings_are_nan_in_both_frames_and_derivatives_are_of_the_clean_signal() -> None:
    block = eitsim.frames(SKIN, rows=2000, dead=0.1, noise_V=0.5, derivatives=True).block(0)
    assert np.array_equal(np.isnan(block["signal_V"]), np.isnan(block["untouched_V"]))
    assert np.mean(np.isnan(block["signal_V"])) == pytest.approx(0.1, rel=0.1)
    assert np.allclose(block["by_touch"], [1, 0, 0, 10])


def test_workers_of_a_loader_share_the_blocks() -> None:
    torch = pytest.importorskip("torch")
    made = eitsim.frames(SKIN, rows=5, seed=1).torch_dataset()
    loader = torch.utils.data.DataLoader(made, batch_size=None)
    blocks = list(itertools.islice(loader, 3))
    assert torch.is_tensor(blocks[0]["signal_V"])
    assert np.array_equal(blocks[2]["touch"], eitsim.frames(SKIN, rows=5, seed=1).block(2)["touch"])


@pytest.mark.parametrize(("given", "says"), [
    ({"nois_V": 1}, "unknown key 'nois_V'"), ({"gain": "big"}, "gain must be a number, a range"),
    ({"gain": [-1, 1]}, "gain is the size of an error, from 0"), ({"gain": {"list": [1, 2]}}, "drawn by chance"),
    ({"force_N": [0, 5]}, "force_N must be from 0.1 to 2"), ({"diameter_mm": 20}, "diameter_mm must be from 10 to 14"),
    ({"within_mm": 60}, "within_mm must be from 0 to 50"), ({"dead": 2}, "dead is a probability"),
    ({"contact_spread": 0.1}, "contact_spread needs the sensor's electrodes"), ({"rows": 0}, "whole number from 1"),
    ({"dtype": "int8"}, "float64 or float32")])
def test_wrong_values_are_refused(given: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        eitsim.frames(SKIN, **given)
