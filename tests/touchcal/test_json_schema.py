"""A shape and its JSON Schema accept and refuse the same documents."""

from typing import Any

import jsonschema
import pytest

import matcal
from matcal import card as card_module
from touchcal.document import Keys, Number, check
from touchcal.json_schema import part, schema

SHAPE = Keys({"count": Number(0, 5, whole=True)}, {"name": (str, None), "pair": [Number(), Number(-1, 1)],
                                                   "each": {str: [bool]}, "any": object}, further=False)


@pytest.mark.parametrize("document", [
    {"count": 3}, {"count": 3, "name": None, "pair": [7, 0.5], "each": {"a": [True]}, "any": [1, "x"]},
    {}, {"count": -1}, {"count": 2.5}, {"count": 3, "name": 4}, {"count": 3, "pair": [1]}, {"count": 3, "pair": [1, 2]},
    {"count": 3, "each": {"a": [1]}}, {"count": 3, "other": 1}, {"count": True}, []])
def test_both_say_the_same(document: Any) -> None:
    try:
        check(document, SHAPE if isinstance(document, dict) else dict)
        sound = isinstance(document, dict)
    except ValueError:
        sound = False
    assert jsonschema.Draft202012Validator(part(SHAPE)).is_valid(document) == sound


def test_a_card_fits_its_schema_and_a_broken_one_does_not() -> None:
    card = matcal.MaterialCard("foam", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                               conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))
    document, validator = card_module.as_json(card), jsonschema.Draft202012Validator(
        schema(card_module._SHAPE, "a material card"))
    validator.check_schema(validator.schema)
    assert [error.message for error in validator.iter_errors(document)] == []
    document["hyperfoam"]["nu"] = [0.7]
    assert not validator.is_valid(document)
