"""Documents whose values are exchanged for any other are read, or refused in one sentence that names file or key."""

import contextlib
import copy
import hashlib
import json
import re
import resource
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as some

import eitsim
import matcal
import surrogate
from eitsim.scene.scene import scene_from
from eitsim.sweeps.dataset.parquet import CONTINUED, SCHEMA, check_manifest, read_manifest
from eitsim.sweeps.design.design import read_design, scene_at
from matcal.card import read_card
from matcal.reduction.specimen import make_specimen, read_tables
from reports.document.page import CONTENTS, read_contents
from surrogate.data.samples import SweepSamples
from surrogate.data.sensor_ring import ring_of_design
from surrogate.model.store import ARRAYS, DESCRIBED, DESCRIPTION, HASH
from touchcal.errors import InputFileError
from touchcal.json_file import digest
from touchcal.toml_file import read_toml

CARD = {"schema": 1, "name": "foam",
        "hyperfoam": {"mu_Pa": [14420.0, 16780.0, -21670.0], "alpha": [0.288, 4.249, 0.741], "nu": [0.0, 0.0, 0.0],
                      "moduli": "longterm", "strain_range": {"uniaxial": [-0.8, 0.0]}},
        "prony": {"g": [0.15, 0.17], "tau_s": [0.3, 5.8]},
        "conductivity": {"c0_S_per_m": 30.0, "a": [-2.0, 2.0, -1.0], "strain_range": [0.0, 0.4]},
        "fit": {"derived": {"mu_0_Pa": {"value": 9530.0, "sd": 10.0}}, "orders": [{"order": 3, "bic": -1.0}],
                "prony": {"slowest_s": 9.0}, "parameters": {"alpha_1": {"value": 0.288, "stderr": None}}},
        "stability": {"drucker": {"uniaxial": {"stable": True, "unstable_strain": []}}},
        "posterior": {"file": "foam.d/posterior.nc", "n": 10, "checks": {"converged": True}},
        "provenance": {"files": [{"name": "a.csv", "sha256": "00"}], "synthetic": True, "seed": 1,
                       "decisions": ["one"], "decisions_of": {"law": 1}, "cpu_s": {"records": 0.1}},
        "data": "foam.d"}
SCENE = {"card": "card.json", "body": {"radius_mm": 100.0, "thickness_mm": 10.0},
         "punch": {"x_mm": 10.0, "y_mm": -5.0, "diameter_mm": 14.0, "force_N": 1.0, "profile": "cone",
                   "fillet_mm": 0.5, "half_angle_deg": 60.0, "friction": "coulomb", "friction_coefficient": 0.3,
                   "conductor": True, "contact_impedance_Ohm_m2": 1e-4},
         "skin": {"thickness_um": 20.0, "strain": "normal"},
         "electrodes": {"kind": "line", "count": 8, "width_mm": [10.0] * 8, "first_angle_deg": 5.0,
                        "contact_impedance_Ohm_m": 1.0, "missing": [3]},
         "drive": {"current_mA": 5.0, "pattern": "skip-1", "reading": "differential"},
         "hold": {"time_s": [1.0, 2.0], "control": "depth", "loading_s": 0.0, "moduli": "card"},
         "accuracy": {"signal": 0.01}}
DRIVEN = {"drive": {"currents": [[1, -1, 0, 0], [0, 1, -1, 0]], "measurements": [[[1, 0, -1, 0]], [[0, 1, 0, -1]]]},
          "electrodes": {"kind": "patch", "count": 4, "angles_deg": [0, 80, 170, 260], "length_mm": 5.0,
                         "contact_impedance_Ohm_m2": [0.01] * 4},
          "punch": [{"x_mm": 0.0, "depth_mm": 1.0}, {"x_mm": 50.0, "profile": "sphere"}]}
OUTLINED = {"body": {"outline": "polygon", "points_mm": [[0, 0], [150, 0], [150, 120], [60, 140], [0, 120]],
                     "holes_mm": [[40, 60, 5], [[100, 60], [120, 60], [110, 75]]], "thickness_mm": 4.0},
            "electrodes": {"count": 6, "width_mm": 8.0, "shares": [0.0, 0.2, 0.3, 0.5, 0.7, 0.85]},
            "punch": {"x_mm": 75.0, "y_mm": 40.0, "diameter_mm": 8.0}}
COVERED = {"body": {"outline": "rectangle", "width_mm": 120.0, "height_mm": 80.0, "corner_radius_mm": 9.0},
           "electrodes": {"kind": "surface", "grid": [3, 2], "pitch_mm": [30.0, 25.0], "width_mm": 6.0,
                          "length_mm": 5.0, "shape": ["disc", "rectangle", "sector", "disc", "disc", "rectangle"],
                          "turn_deg": 20.0, "opening_deg": 80.0}}
DESIGN = {"scenes": 4, "seed": 3, "sampler": "lhs", "touches": [1, 2],
          "punch": {"diameter_mm": {"choice": [10, 12]}, "force_N": {"dist": "lognormal", "mean": 1.0, "sd": 0.5},
                    "fillet_mm": {"dist": "normal", "mean": 0.5, "sd": 0.1, "lo": 0.2, "hi": 1.0},
                    "place": {"within_mm": 40.0, "gap_mm": 10.0, "apart_mm": 3.0}},
          "body": {"thickness_mm": [8.0, 12.0]}, "skin": {"thickness_um": {"dist": "loguniform", "lo": 5, "hi": 50}},
          "material": {"posterior": True, "draws": 2, "rows_per_draw": 1, "parts": ["hyperfoam"], "specimen": False},
          "measurement": {"noise_V": 1e-6, "gain": 0.01, "bits": 16, "full_scale_V": 0.1, "frames": 2},
          "fields": {"names": ["strain"], "grid": "square", "side": 8}}
LISTED = {"punch": {"place": {"grid": "sunflower", "count": 5}, "force_N": {"list": [0.1, 1.0]}},
          "hold": {"time_s": {"list": [1.0, 2.0]}}}
PLACED = {"scenes": 3, "punch": {"diameter_mm": [6, 9], "place": {"gap_mm": 5.0, "within_mm": 90.0}},
          "body": OUTLINED["body"] | {"thickness_mm": [3.0, 5.0]}, "electrodes": OUTLINED["electrodes"]}
GRID = {"scenes": 5, "punch": {"place": {"grid": "polar", "spacing_mm": 20.0}}, "electrodes": {"count": 8}}
SPECIMEN = {"uniaxial": {"diameter_mm": 50.0, "height_mm": 25.0, "compliance_mm_per_N": 0.0, "preload_N": 0.1,
                         "direction": "compression"},
            "shear": {"faces": 2, "length_mm": 50.0, "width_mm": 20.0, "thickness_mm": 10.0},
            "planar": {"length_mm": 10.0, "width_mm": 50.0, "thickness_mm": 2.0},
            "volumetric": {"method": "confined", "diameter_mm": 50.0, "height_mm": 10.0, "lateral_ratio": 0.2},
            "conductivity": {"length_mm": 40.0, "width_mm": 10.0, "thickness_mm": 2.0, "coating_um": 20.0,
                             "voltage_V": 1.0}}
MANIFEST = {"schema": SCHEMA, "design": {"scenes": 4, "seed": 1, "sampler": "random", "tables": {
                "punch": {"force_N": [0.1, 1.0]}, "accuracy": {"signal": 0.01}}, "material": None, "measurement": {},
                "fields": None, "touches": None, "source": None},
            "card": {"name": "foam", "file": "card.json", "sha256": "00", "synthetic": True},
            "versions": {"numpy": "2"}, "method": {"exact": False, "reuse": None, "rim": False, "reason": "few"},
            "rows_per_part": 16, "code": "00", "posterior": {}, "runs": [], "left_out": []}
LIST = {"inputs": [], "files": ["a.svg"]}

WRONG = [None, True, False, "", "x", "8000", [], {}, [[]], [None], {"x": 1}, [1, 2, 3], [1e300, -1e300], 0, 1, -1, 3,
         0.5, 1e-9, 1e-300, -1e-300, 1e300, -1e300, 1e15, 10**12, 10**18, 2**63, -2**63, float("inf"), float("nan"),
         {"list": [1, None]}, {"rows": [1, 2]}, {"choice": [1e300]}, {"dist": "normal", "mean": 1e300, "sd": 1e-300},
         {"dist": "lognormal", "mean": 1e-9, "sd": 1e9}, [[1, 2], [3]], "flat", "opposite", "\u0000\ud7ff", "1" * 50]


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where values stand in a document."""
    if path:
        yield path
    held = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in held:
        yield from places(each, (*path, key))


def at(document: Any, path: tuple[Any, ...]) -> Any:
    """The value that stands there."""
    return at(document[path[0]], path[1:]) if path else document


def changed(document: Any, draw: Callable[..., Any]) -> Any:
    """A document of which one to three values are exchanged, removed, repeated, scaled or joined by a foreign key."""
    document = copy.deepcopy(document)
    for _ in range(draw(some.sampled_from([1, 1, 1, 2, 3]))):
        where = [*places(document)]
        numbers = [path for path in where if isinstance(at(document, path), float | int)]
        where = numbers if numbers and draw(some.sampled_from([True, True, False])) else where
        if not where:
            break
        *path, last = draw(some.sampled_from(where))
        held = at(document, tuple(path))
        how = draw(some.sampled_from(["other", "other", "scaled", "scaled", "scaled", "removed", "listed", "foreign",
                                      "elsewhere"]))
        if how == "removed":
            del held[last]
        elif how == "listed":
            held[last] = [copy.deepcopy(held[last]) for _ in range(draw(some.sampled_from([0, 1, 2, 4, 9])))]
        elif how == "foreign" and isinstance(held, dict):
            held[draw(some.sampled_from(["colour", "scenes", "punch", "", "x y"]))] = copy.deepcopy(held[last])
        elif how == "scaled" and isinstance(held[last], float | int):
            held[last] = held[last] * draw(some.sampled_from([-1, 2, 0.5, 100, 1e-12, 1e-6, 1e-3, 1e3, 1e6, 1e12]))
        elif how == "elsewhere":
            held[last] = copy.deepcopy(at(document, draw(some.sampled_from([*places(document)]))))
        else:
            held[last] = copy.deepcopy(draw(some.sampled_from(WRONG)))
    return document


def as_toml(value: Any) -> str:
    """A value as TOML; null, which TOML has not, as an empty list."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {as_toml(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    return "[]" if value is None else json.dumps(value).replace("Infinity", "inf").replace("NaN", "nan")


def toml(document: dict[str, Any]) -> str:
    return "".join(f"{json.dumps(key)} = {as_toml(value)}\n" for key, value in document.items())


def planned(path: Path) -> None:
    scene = eitsim.read_scene(path)
    if len(scene.punches) < 9:
        eitsim.plan(scene, GOOD_CARD)


def solved_with(path: Path) -> None:
    card = read_card(path)
    if card.hyperfoam is not None:
        eitsim.plan(GOOD_SCENE, card)


def drawn(path: Path) -> None:
    design = read_design(path)
    for index in range(min(design.scenes, 3)):
        scene = scene_at(design, index)
        if len(scene.punches) < 9:
            eitsim.plan(scene, GOOD_CARD)


def sized(path: Path) -> None:
    for kind, table in read_tables(path).items():
        make_specimen(kind, table, path)


def stands(path: Path) -> None:
    check_manifest(path.parent, read_manifest(path.parent), CONTINUED)


def learnt() -> surrogate.Model:
    """A model of made-up touches."""
    rng, number = np.random.default_rng(1), np.arange(30)
    ring = ring_of_design({})
    readings = len(ring.read)
    signal, baseline = rng.normal(0, 1e-3, (30, readings)), rng.uniform(1, 2, (30, readings))
    rows = SweepSamples(signal_V=signal, target=rng.uniform(1, 2, (30, 8)), group=number, ring=ring, scene=number,
                        baseline_V=baseline, card=np.full(30, -1), material=np.empty((30, 0)), signal_sd=np.zeros(30),
                        row_hash=number.astype(np.uint64), near_edge=np.zeros(30, bool),
                        relaxation={"g": [0.2], "tau_s": [1.0], "moduli": "longterm"})
    return surrogate.train(rows, method="ridge", outputs="x0,y0,F", seed=1)


def tied(folder: Path, text: Any, arrays: Any) -> None:
    """Write the files of a model with hashes that fit, as who changes one of them would not."""
    rest = {key: value for key, value in text.items() if key != HASH} if isinstance(text, dict) else {}
    np.savez(folder / ARRAYS, allow_pickle=False, **arrays | {DESCRIBED: np.array(digest(rest))})
    if isinstance(text, dict) and HASH in text:
        text = {**text, HASH: hashlib.sha256((folder / ARRAYS).read_bytes()).hexdigest()}
    (folder / DESCRIPTION).write_text(json.dumps(text), encoding="utf-8")


def loaded(path: Path) -> None:
    with contextlib.suppress(ValueError, RecursionError):
        tied(path.parent, json.loads(path.read_text(encoding="utf-8-sig")), GOOD_ARRAYS)
    surrogate.load(path.parent)


GOOD_MODEL = learnt()
with tempfile.TemporaryDirectory() as place:
    GOOD_MODEL.save(place)
    GOOD_TEXT = json.loads((Path(place) / DESCRIPTION).read_text())
    with np.load(Path(place) / ARRAYS) as file:
        GOOD_ARRAYS = {name: file[name] for name in file.files}
GOOD_CARD = matcal.MaterialCard(
    "foam", matcal.Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3)),
    matcal.Prony(np.array([0.15, 0.17]), np.array([0.3, 5.8])),
    matcal.Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4)))
GOOD_SCENE = eitsim.Scene()
# name of a file -> what is made of it, what it holds
KINDS: dict[str, tuple[Callable[[Path], object], tuple[dict[str, Any], ...]]] = {
    "card.json": (solved_with, (CARD,)), "scene.toml": (planned, (SCENE, DRIVEN, OUTLINED, COVERED)),
    "draws.toml": (drawn, (DESIGN, LISTED, GRID, PLACED)), "specimen.toml": (sized, (SPECIMEN,)),
    "design.json": (stands, (MANIFEST,)), DESCRIPTION: (loaded, (GOOD_TEXT,)),
    CONTENTS: (lambda path: read_contents(path.parent), (LIST,))}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder, in which the documents as they are are used without an error."""
    folder = tmp_path_factory.mktemp("documents")
    for name, (use, documents) in KINDS.items():
        for document in documents:
            use(written(folder / name, document))
    return folder


def written(path: Path, document: dict[str, Any]) -> Path:
    path.write_text(json.dumps(document) if path.suffix == ".json" else toml(document), encoding="utf-8")
    return path


def check_answer(path: Path, use: Callable[[Path], object], document: Any) -> None:
    """It is used within a second, or refused by a sentence that names the file or a key of it."""
    began = time.process_time()
    try:
        use(path)
    except ValueError as error:
        said = str(error)
        keys = {str(key) for where in places(document) for key in where if isinstance(key, str) and key}
        assert path.name in said or any(key in said for key in keys), said
        assert re.search(r"[.!?]$", said.strip()), said
    assert time.process_time() - began < 1


def trial(name: str, folder: Path) -> Callable[[some.DataObject], None]:
    use, documents = KINDS[name]

    def run(data: some.DataObject) -> None:
        document = changed(data.draw(some.sampled_from(documents)), data.draw)
        check_answer(written(folder / name, document), use, document)

    return run


HUGE = 10**400


def with_value(document: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    """A document with another value at a key, given as its way from the top; numbers count list entries."""
    document = copy.deepcopy(document)
    *path, last = (int(part) if part.isdigit() else part for part in key.split("."))
    at(document, tuple(path))[last] = value
    return document


@pytest.mark.parametrize(("name", "document", "key", "value", "named"), [
    *(("card.json", CARD, "hyperfoam", wrong, "hyperfoam must be an object") for wrong in ([], None, "x", 3)),
    *(("card.json", CARD, "provenance", wrong, "provenance must be an object") for wrong in ([], None)),
    ("card.json", CARD, "hyperfoam.strain_range", None, "hyperfoam.strain_range must be an object"),
    ("card.json", CARD, "hyperfoam.strain_range", [0, 1], "hyperfoam.strain_range must be an object"),
    ("card.json", CARD, "conductivity.strain_range", [0.1], "conductivity.strain_range must be a list of 2 values"),
    ("card.json", CARD, "conductivity.strain_range", [0.4, 0.1], "lowest strain 0.4 is above the highest 0.1"),
    ("card.json", CARD, "hyperfoam.mu_Pa", [True, True, True], r"hyperfoam.mu_Pa\[0\] must be a finite number"),
    ("card.json", CARD, "hyperfoam.mu_Pa", ["8000", 1.0, 1.0], r"hyperfoam.mu_Pa\[0\] must be a finite number"),
    ("card.json", CARD, "hyperfoam.mu_Pa", [1e-300, 1e-300, 1e-300], "mu_0 = sum of mu_Pa must be from 0.001 to 1e.13"),
    ("card.json", CARD, "hyperfoam.alpha.0", 1e-300, "hyperfoam.alpha must be at least 1e-06 in size"),
    ("card.json", CARD, "hyperfoam.mu_Pa.0", HUGE, r"hyperfoam.mu_Pa\[0\] is a whole number of 400 digits"),
    ("card.json", CARD, "conductivity.c0_S_per_m", HUGE, "conductivity.c0_S_per_m is a whole number of 400 digits"),
    ("card.json", CARD, "data", "/etc", "data must lie next to the card"),
    ("card.json", CARD, "data", "../other", "data must lie next to the card"),
    ("card.json", CARD, "posterior.file", "/etc/passwd", "posterior.file must lie next to the card"),
    ("scene.toml", SCENE, "punch.force_N", HUGE, "punch.force_N is a whole number of 400 digits"),
    ("scene.toml", SCENE, "body.radius_mm", 1e300, r"radius_mm in \[body\] must be from 0.001 to 10000 mm"),
    ("scene.toml", SCENE, "body.radius_mm", 1e9, r"radius_mm in \[body\] must be from 0.001 to 10000 mm"),
    ("scene.toml", SCENE, "skin.thickness_um", 1e300, r"thickness_um in \[skin\] must be from 0.001 to 10000 um"),
    ("scene.toml", SCENE, "electrodes.width_mm", 1e-9, r"width_mm in \[electrodes\] must be from 0.001 to 10000 mm"),
    ("scene.toml", SCENE, "electrodes.contact_impedance_Ohm_m", 1e300, r"contact_impedance_Ohm_m in \[electrodes\]"),
    ("scene.toml", SCENE, "punch.half_angle_deg", 0.001, r"half_angle_deg in \[punch\] must be from 1 to 89 deg"),
    ("scene.toml", SCENE, "accuracy.signal", 1e-300, r"signal in \[accuracy\] must be from 1e-09 to 1,"),
    ("scene.toml", SCENE, "card", ["card.json"], "card must be the name of a file"),
    ("scene.toml", SCENE, "drive", {"measurements": "nosuch.csv"}, "no such file of rows"),
    ("scene.toml", SCENE, "drive", {"measurements": "/dev/zero"}, "this is a pipe or a device"),
    ("scene.toml", COVERED, "electrodes.grid.0", 10**12, r"grid in \[electrodes\] has 2000000000000 electrodes"),
    ("scene.toml", SCENE, "punch", [{}] * 1000, "punch holds 1000 touches; at most 100"),
    ("draws.toml", LISTED, "punch.place.count", 10**12, r"count of place .* from 1 to 100,000"),
    ("draws.toml", GRID, "punch.place.spacing_mm", 0.1, "spacing_mm of place .* must be at least"),
    ("draws.toml", DESIGN, "touches", 10**9, "touches must be a whole number from 1 to 100"),
    ("draws.toml", DESIGN, "scenes", 10**18, "scenes = 1000000000000000000: at most 1,000,000"),
    ("draws.toml", DESIGN, "measurement.gain", HUGE, "measurement.gain is a whole number of 400 digits"),
    ("draws.toml", DESIGN, "punch.force_N.sd", 1e300, "force_N .* holds 1e.300"),
    ("specimen.toml", SPECIMEN, "uniaxial.height_mm", HUGE, "height_mm is a whole number of 400 digits"),
    *(("specimen.toml", SPECIMEN, "uniaxial.height_mm", size, r"\[uniaxial\] height_mm = .* from 0.001 to 10000")
      for size in (1e-300, 1e300)),
    ("specimen.toml", SPECIMEN, "shear.faces", 0.5, r"\[shear\] faces = 0.5 must be a whole number"),
    *((DESCRIPTION, GOOD_TEXT, "method", wrong, "method .* is not one that this version reads")
      for wrong in ([], ["ridge"], {}, None)),
    *(("design.json", MANIFEST, "design", wrong, "design must be an object") for wrong in ([], None)),
    *(("design.json", MANIFEST, "rows_per_part", wrong, "rows_per_part must be a whole number") for wrong in (0, "x")),
    ("design.json", MANIFEST, "runs", 3, "runs must be a list"),
    *((CONTENTS, LIST, "files", wrong, "files.* must be a") for wrong in (3, [3]))])
def test_values_of_the_review_are_refused_by_their_key(name: str, document: dict[str, Any], key: str, value: Any,
                                                       named: str, folder: Path) -> None:
    began = time.process_time()
    with pytest.raises(InputFileError, match=named) as caught:
        KINDS[name][0](written(folder / name, with_value(document, key, value)))
    assert name in str(caught.value)
    assert time.process_time() - began < 1


@pytest.mark.parametrize("body", [{"thickness_mm": 1e-3}, {"thickness_mm": 0.1, "radius_mm": 1000.0}])
def test_foam_too_thin_for_its_mesh_is_refused_before_it_is_meshed(body: dict[str, float]) -> None:
    punch = {"diameter_mm": 100.0 if "radius_mm" in body else 14.0, "profile": "sphere"}
    began = time.process_time()
    said = eitsim.plan(scene_from({"body": body, "punch": punch}), GOOD_CARD).refusal
    assert re.match(r"thickness_mm = \S+ in \[body\] is so little .* give a thickness of \S+ mm or more", said)
    assert time.process_time() - began < 1
    more = {**body, "thickness_mm": float(re.findall(r"thickness of (\S+) mm", said)[0]) * 1.05}
    assert "elements across" not in eitsim.plan(scene_from({"body": more, "punch": punch}), GOOD_CARD).refusal


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize(("content", "named"), [
    (b"\xff\xfe\x00", "not UTF-8 text: byte 0xff.*Save it as UTF-8"), (b"[" * 200_000, "not|deep|must be"),
    (b"a = " + b"[" * 3000, "deep|not JSON"), (b"a = " + b"1" * 5000, "not TOML|not JSON"), (b"[1", "must|not"),
    (b"null", "must|not TOML"), (b".".join([b"a"] * 1000) + b" = 1", "deep|not JSON")])
def test_text_that_is_no_document_is_refused_by_its_file(name: str, content: bytes, named: str, folder: Path) -> None:
    (folder / name).write_bytes(content)
    with pytest.raises(InputFileError, match=named) as caught:
        KINDS[name][0](folder / name)
    assert name in str(caught.value)
    assert "sys." not in str(caught.value)  # advice for programmers


@pytest.mark.parametrize(("line", "said"), [("thickness_mm = 5,5", True), ("thickness_mm = -0,5  # thin", True),
                                            ("names = [1,2", False), ("name = word", False)])
def test_a_decimal_comma_is_named(line: str, said: bool, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(f"[body]\n{line}\n")
    with pytest.raises(InputFileError, match="not TOML") as caught:
        read_toml(tmp_path / "scene.toml")
    assert ("with a point, not a comma" in str(caught.value)) is said


@pytest.mark.parametrize("name", KINDS)
def test_a_byte_order_mark_is_no_mistake(name: str, folder: Path) -> None:
    use, (document, *_) = KINDS[name]
    path = written(folder / name, document)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    use(path)


QUIET = {"deadline": None, "suppress_health_check": [*HealthCheck], "database": None}


@pytest.mark.parametrize("name", KINDS)
def test_changed_documents_are_used_or_refused(name: str, folder: Path) -> None:
    settings(max_examples=60, derandomize=True, **QUIET)(given(some.data())(trial(name, folder)))()


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_five_thousand_changed_documents_are_used_or_refused(name: str, folder: Path) -> None:
    before, others = 0, {path: path.read_bytes() for path in folder.iterdir() if path.name not in (name, ARRAYS)}
    for count in (200, 5000):
        settings(max_examples=count, derandomize=True, **QUIET)(given(some.data())(trial(name, folder)))()
        before = before or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200e3  # kB; Hypothesis keeps its examples
    assert others == {path: path.read_bytes() for path in folder.iterdir() if path.name not in (name, ARRAYS)}


def spoilt_arrays(data: some.DataObject) -> None:
    """A model one of whose arrays is cut, turned, of other numbers or of words is used or refused by its folder."""
    name = data.draw(some.sampled_from([*GOOD_ARRAYS]))
    held = GOOD_ARRAYS[name]
    other = data.draw(some.sampled_from([held[..., :1] if held.ndim else held.reshape(1, 1), held[:0] if held.ndim else
                                         held.reshape(1)[:0], held.T, held[None], held.astype(str), np.array(3),
                                         np.zeros_like(held), np.full(held.shape, np.nan),
                                         np.full(held.shape, 10**12), np.full(held.shape, -1)]))
    with tempfile.TemporaryDirectory() as place:
        tied(Path(place), GOOD_TEXT, GOOD_ARRAYS | {name: other})
        try:
            model, frames = surrogate.load(place), GOOD_MODEL.baseline_V + GOOD_MODEL.calibration.signal_V
            model.predict(frames, noise_V=1e-6, held_s=1.0)
        except ValueError as error:
            said = str(error)
            assert place in said


def test_models_of_spoilt_arrays_are_used_or_refused() -> None:
    settings(max_examples=80, derandomize=True, **QUIET)(given(some.data())(spoilt_arrays))()


def test_patterns_without_an_end_are_refused(command: Callable[..., Any], folder: Path) -> None:
    scene, card = written(folder / "scene.toml", SCENE), written(folder / "card.json", CARD)
    done = command("eitsim", "run", scene, "--card", card, "--skin", folder / "a.vtu", "--skin-patterns=inf")
    assert done.returncode == 2
    assert "--skin-patterns must hold whole numbers, got inf" in done.stderr
