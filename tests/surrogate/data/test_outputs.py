"""Quantities to predict: what each is of stands in its own line, and nothing else knows the list."""

from pathlib import Path

import numpy as np
import pytest

import surrogate
from eitsim.sweeps.dataset import parquet
from surrogate.data import outputs
from surrogate.data.outputs import Role
from surrogate.data.samples import SweepSamples, read_samples


def test_every_quantity_has_a_unit_and_the_touch_comes_first() -> None:
    assert all(output.unit in outputs.SI for output in outputs.ALL)
    flat = [output for output in outputs.ALL if output.role is not Role.HEIGHT]
    roles = [output.role is Role.RESPONSE for output in flat]
    assert roles == sorted(roles)
    assert (*outputs.TOUCHES, *outputs.RESPONSES, "z0") == outputs.NAMES
    assert outputs.PLACES == (*outputs.TOUCHES[:2], "z0") == ("x0", "y0", "z0")


def test_a_set_from_before_a_quantity_was_computed_is_read_without_it(sweep: Path, samples: SweepSamples,
                                                                      tmp_path: Path) -> None:
    for path in parquet.parts(sweep):
        parquet.write_table(tmp_path / path.name, parquet.decoded(path).drop(columns="delta_max_mm"))
    parquet.write_manifest(tmp_path, parquet.read_manifest(sweep))
    older = read_samples(tmp_path)
    assert older.names == samples.names[:-1]
    np.testing.assert_array_equal(older.target, samples.target[:, :-1])
    assert surrogate.train(older, "ridge").names == older.names
    with pytest.raises(ValueError, match=r"nothing of the output 'delta_max'; they have x0, .* sweep again"):
        surrogate.train(older, "ridge", "x0,delta_max")
