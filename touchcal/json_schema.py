"""Shapes of documents (`touchcal.document`) as JSON Schema, for editors and programs of others."""

import math
from typing import Any

from touchcal.document import Keys, Number

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_TYPES = {str: "string", bool: "boolean", dict: "object", list: "array", None: "null"}


def schema(shape: Any, title: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a whole document of this shape."""
    return {"$schema": DIALECT, "title": title} | part(shape)


def part(shape: Any) -> dict[str, Any]:
    """The JSON Schema of one part."""
    if isinstance(shape, Number):
        ends = {"minimum": shape.least, "maximum": shape.most}
        return {"type": "integer" if shape.whole else "number"} | {key: end for key, end in ends.items()
                                                                   if math.isfinite(end)}
    if isinstance(shape, tuple):
        return {"anyOf": [part(one) for one in shape]}
    if isinstance(shape, list):
        if len(shape) == 1:
            return {"type": "array", "items": part(shape[0])}
        return {"type": "array", "prefixItems": [part(one) for one in shape], "minItems": len(shape),
                "maxItems": len(shape)}
    if isinstance(shape, Keys):
        return {"type": "object", "required": list(shape.needed), "additionalProperties": shape.further,
                "properties": {key: part(one) for key, one in {**shape.needed, **shape.allowed}.items()}}
    if isinstance(shape, dict):
        return {"type": "object", "additionalProperties": part(shape[str])}
    return {} if shape is object else {"type": _TYPES[shape]}
