"""Reference pages from the code: commands, keys of files, what packages export, shapes of documents."""

import dataclasses
import importlib
import io
import json
import math
import re
import tokenize
import types
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import typer

from eitsim.scene.electrodes import KINDS, SHAPES
from touchcal.document import Keys, Number

COMMANDS = ("matcal", "eitsim", "surrogate")
# name of a schema -> what it describes, and the module whose _SHAPE it is
SCHEMAS = {"material-card": ("a material card, as `matcal fit` writes it", "matcal.card"),
           "calibrated-sensor": ("`sensor.json`, as `eitsim sensor fit` writes it",
                                 "eitsim.scene.calibrated_electrodes"),
           "data-set": ("`design.json` of a data set, as `eitsim sweep` writes it", "eitsim.sweeps.dataset.parquet"),
           "model": ("`model.json` of a model of a data set, as `surrogate train` writes it",
                     "surrogate.model.sweep_model"),
           "recording-model": ("`model.json` of a model of a recording, as `surrogate learn` writes it",
                               "surrogate.model.recorded.press_model")}
# (table, key) -> what it may hold, where the scene checks that with other keys
LISTED = {("electrodes", "kind"): KINDS, ("electrodes", "shape"): SHAPES}
# table -> further keys of a file, which name another file or stand for several keys, each with its meaning
SHORT = {"body": {"outline": "or a CSV, DXF, SVG or mesh file of the outer edge and its holes",
                  "points_mm": "or a file of the outer edge alone"},
         "electrodes": {"grid": "[columns, rows] of electrodes on the surface about the origin",
                        "pitch_mm": "steps of the grid along x and y",
                        "places": "CSV of electrodes on the surface: `x_mm`, `y_mm`, and what differs of each",
                        "groups": "name that numbered groups of lines of the mesh in `outline` begin with: they "
                                  "are the electrodes",
                        "calibrated": "`sensor.json` of `eitsim sensor fit`: its electrodes and channels, without any "
                                      "other key"},
         "drive": {"currents": "or a CSV of them", "measurements": "or a CSV of them"}}
_DIALECT = "https://json-schema.org/draft/2020-12/schema"
_TYPES = {str: "string", bool: "boolean", dict: "object", list: "array", None: "null"}
_SCENE = """card = "card.json"

[punch]
x_mm = 20
y_mm = -10
diameter_mm = 14
force_N = 1

[electrodes]
count = 16
"""


def write(folder: Path) -> None:
    """Write every reference page into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {"commands": commands(), "scene-keys": scene_keys(), **{f"api-{name}": api(name) for name in COMMANDS}}
    pages["schemas"] = schemas(folder)
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def commands() -> str:
    """Every command with its options, from the programs themselves."""
    parts = ["# Commands\n"]
    for name in COMMANDS:
        parts += _command(name, typer.main.get_command(importlib.import_module(f"{name}.cli.main").app), 2)
    return "\n".join(parts)


def _command(name: str, command: Any, level: int) -> list[str]:
    out = [f"{'#' * min(level, 6)} {name}\n", *_help(command.help or "")]
    listed = getattr(command, "commands", {})
    if not listed:
        usage = command.collect_usage_pieces(command.make_context(name, [], resilient_parsing=True))
        out += ["```text", f"{name} {' '.join(usage)}", "```\n"]
    rows = [(_name(option), _cell(getattr(option, "help", "") or "")) for option in command.params
            if not getattr(option, "hidden", False)]
    out += _table(("option", "meaning"), rows)
    for each, one in listed.items():
        out += _command(f"{name} {each}", one, level + 1)
    return out


def _name(option: Any) -> str:
    """An option as it is typed, or an argument in capitals."""
    if option.param_type_name == "option":
        return ", ".join(f"`{one}`" for one in (*option.opts, *option.secondary_opts))
    return f"`{str(option.metavar or option.name).upper()}`"


def _help(text: str) -> list[str]:
    """Paragraphs as prose, indented lines as a block of code."""
    out = []
    for part in text.replace("\b\n", "\b").strip().split("\n\n"):
        code = part.startswith(("\b", "    ", "  "))
        shown = re.sub(r"^Example: (.*)", r"Example: `\1`", part.replace("\n", " "))
        out += [f"```text\n{part.strip(chr(8))}\n```\n"] if code else [shown + "\n"]
    return out


def schemas(folder: Path) -> str:
    """JSON Schemas, written into a folder, and the page that links them."""
    rows = []
    for name, (title, module) in SCHEMAS.items():
        found = schema(importlib.import_module(module)._SHAPE, title)
        (folder / f"{name}.schema.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
        rows.append((f"[{name}.schema.json]({name}.schema.json)", title))
    return "\n".join(["# Schemas of files\n", "JSON Schemas (draft 2020-12) made from the shapes that the programs "
                      "check when they read a file. How numbers go together is checked by the programs alone.\n",
                      *_table(("schema", "of"), rows)])


def schema(shape: Any, title: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a whole document of this shape."""
    return {"$schema": _DIALECT, "title": title} | part_of(shape)


def part_of(shape: Any) -> dict[str, Any]:
    """The JSON Schema of one part."""
    if isinstance(shape, Number):
        ends = {"minimum": shape.least, "maximum": shape.most}
        return {"type": "integer" if shape.whole else "number"} | {key: end for key, end in ends.items()
                                                                   if math.isfinite(end)}
    if isinstance(shape, tuple):
        return {"anyOf": [part_of(one) for one in shape]}
    if isinstance(shape, list):
        if len(shape) == 1:
            return {"type": "array", "items": part_of(shape[0])}
        return {"type": "array", "prefixItems": [part_of(one) for one in shape], "minItems": len(shape),
                "maxItems": len(shape)}
    if isinstance(shape, Keys):
        return {"type": "object", "required": list(shape.needed), "additionalProperties": shape.further,
                "properties": {key: part_of(one) for key, one in {**shape.needed, **shape.allowed}.items()}}
    if isinstance(shape, dict):
        return {"type": "object", "additionalProperties": part_of(shape[str])}
    return {} if shape is object else {"type": _TYPES[shape]}


def scene_keys() -> str:
    """Every key of a scene file, with its unit, default and meaning."""
    scene = importlib.import_module("eitsim.scene.scene")
    parts = ["# Keys of a scene file\n",
             "A scene is a TOML file of these tables; a key that is left out has its default. A file with a list of "
             "tables `[[punch]]` has one touch a table. The same keys stand in a design, where a list of two numbers "
             "is a range to draw from.\n",
             "Above the tables may stand `card`, the material card that the file is solved with, relative to it.\n",
             "A whole file, which `eitsim run scene.toml` solves; each table is described below:\n",
             f"```toml\n{_SCENE}```\n"]
    for table, keys in scene._KEYS.items():
        kind = scene._CLASSES[table]
        notes, short = comments(kind), SHORT.get(table, {})
        rows = []
        for key, (name, per) in keys.items():
            value = getattr(kind(), name)
            known = scene._words().get((table, key)) or LISTED.get((table, key))
            words = f"; one of {', '.join(f'`{word}`' for word in known)}" if known else ""
            shown = _default(None if value is None else scene._unconverted(value, per))
            also = f"; {short[key]}" if key in short else ""
            rows.append((f"`{key}`", shown, _cell(_in_words(notes.get(name, "")) + words + also).lstrip("; ")))
        rows += [(f"`{key}`", "none", meaning) for key, meaning in short.items() if key not in keys]
        parts += [f"## [{table}]\n", _summary(kind) + "\n", *_table(("key", "default", "meaning"), rows)]
    return "\n".join(parts)


def _summary(kind: Any) -> str:
    """The first paragraph of a docstring, without what is raised."""
    return " ".join((kind.__doc__ or "").split("\n\n")[0].split(" ValueError ")[0].split())


def _in_words(note: str) -> str:
    """A comment without what its key says: names of constants and units in SI."""
    note = re.sub(r"(, )?one of [A-Z_]+(: )?", "", note)
    note = re.sub(r"[,;] (m|rad|N|s|A|Ohm m(\^2)?)(?=[;,.]|$)", "", note)
    note = note.replace("None where", "left out where").replace("None: ", "left out: ")
    return note.replace("current_A", "current_mA")


def _default(value: Any) -> str:
    if value is None or value in ((), []):
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def comments(kind: type) -> dict[str, str]:
    """Field, inherited ones too -> the comment that stands behind it, or above it and all that follow without their
    own."""
    found: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        if "__dataclass_fields__" in vars(one):
            found |= _own_comments(one)
    return found


def _own_comments(kind: type) -> dict[str, str]:
    source = io.StringIO(Path(importlib.import_module(kind.__module__).__file__ or "").read_text(encoding="utf-8"))
    names = {one.name for one in dataclasses.fields(kind)}
    found: dict[str, str] = {}
    above, inside, name, fresh = "", False, "", False
    for token in tokenize.generate_tokens(source.readline):
        if token.type == tokenize.NAME and token.line.startswith(f"class {kind.__name__}"):
            inside = True
        elif inside and token.type == tokenize.NAME and token.line and not token.line[0].isspace():
            break
        if not inside:
            continue
        first = token.line.split(":")[0].strip()
        if token.type == tokenize.NAME and first in names and token.string == first:
            name, fresh = first, False
            found[name] = above
        elif token.type == tokenize.COMMENT:
            text = token.string.lstrip("# ")
            if token.line.strip().startswith("#"):
                above = f"{above} {text}" if fresh else text
                fresh = True
            else:
                found[name], above = text, ""
    return found


def api(name: str) -> str:
    """What a package exports."""
    package = importlib.import_module(name)
    lines = [f"# {name} in Python\n", (package.__doc__ or "").split("\n\n")[0].replace("\n", " ") + "\n"]
    names = sorted(package.__all__, key=str.lower)
    lines += _table(("name", "what it is"), [(f"[`{each}`](#{each.lower()})", _cell(_summary(getattr(package, each))))
                                             for each in names if callable(getattr(package, each))])
    for each in names:
        thing = getattr(package, each)
        if isinstance(thing, type):
            lines += [f"## {each}\n", "```{eval-rst}", f".. autoclass:: {name}.{each}", "   :members:", "```\n",
                      *_fields(thing)]
        elif isinstance(thing, types.UnionType):
            lines += [f"## {each}\n", f"`{name}.{each}`: {' or '.join(one.__name__ for one in thing.__args__)}\n"]
        elif callable(thing):
            lines += [f"## {each}\n", "```{eval-rst}", f".. autofunction:: {name}.{each}", "```\n"]
        else:
            lines += [f"## {each}\n", f"`{name}.{each}`: {', '.join(map(str, thing))}\n"]
    return "\n".join(lines)


def _fields(kind: type) -> list[str]:
    """What the comments of a dataclass say of its fields, as a table."""
    notes = comments(kind) if dataclasses.is_dataclass(kind) else {}
    return _table(("field", "meaning"), [(f"`{one.name}`", _cell(_with_words(kind, notes[one.name])))
                                         for one in (dataclasses.fields(kind) if notes else ()) if notes.get(one.name)])


def _with_words(kind: type, note: str) -> str:
    """A comment with the words of a constant in place of its name, which a module of the class or the named one has."""
    own = [one.__module__ for one in kind.__mro__]

    def words(found: re.Match[str]) -> str:
        modules = [importlib.import_module(one) for one in ([found[2][:-1]] if found[2] else own)]
        listed = next(vars(one)[found[3]] for one in modules if found[3] in vars(one))
        return f"{found[1]} of {', '.join(f'`{word}`' for word in listed)}"
    return re.sub(r"\b(one|some) of ([\w.]+\.)?([A-Z_]{3,})\b", words, note)


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    listed = list(rows)
    if not listed:
        return []
    return [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}", *(f"| {' | '.join(row)} |" for row in listed), ""]


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
