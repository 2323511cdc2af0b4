"""The stages of the paper's report, at two settings: quick, and full with the paper's 4,000 scenes."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks.paper.section import PUBLISHED
from benchmarks.paper.stages import Stage, state
from eitsim.sweeps.dataset.code_history import other_code
from eitsim.sweeps.dataset.parquet import read_manifest
from eitsim.sweeps.design.design import read_design, tables_at
from matcal.card import card_identity, read_card
from reports.document.provenance import source
from touchcal.code_version import ROOT, code_hash

DATA, EXAMPLES, SCENES = ROOT / "data_raw", ROOT / "examples", Path(__file__).parent / "scenes"
SEED = "1"
# names of the stages, in the order in which they are made
CARD, CYCLES, TOUCH, FIRST, SECOND = "card", "cycles", "touch", "first_scene", "second_scene"
# what is kept -> its stage; the last is loaded in the time that LOADING finds
HOLDS = {"force": "hold_force", "depth": "hold_depth", "depth after slow loading": "hold_loaded"}
LOADING, CHOICES, CONVERGENCE, SWEEP = "loading", "choices", "convergence", "sweep"
NETWORKS, FORWARD, FOLLOWED = "networks", "forward", "followed"


@dataclass(frozen=True)
class Setting:
    """How large a run is."""

    name: str
    scenes: int  # scenes of the sweep
    epochs: int  # most steps of the paper's networks


# what a quick run takes where nothing is kept, as Makefile, docs and the command's help say
COST = "seven CPU minutes, within five minutes on two idle cores"
QUICK, FULL = Setting("quick", 200, 60), Setting("full", 4000, 100)


@dataclass(frozen=True)
class Run:
    """A run of the report: its stages, and the results that were given to it instead of made by it."""

    setting: Setting
    stages: Mapping[str, Stage]
    card: Path
    sweep: Path  # its folder
    given_sweep: bool  # whether the sweep is one that was given


def planned(setting: Setting, work: Path, *, card: Path | None = None, sweep: Path | None = None,
            workers: int = 2) -> Run:
    """The stages of a run whose results lie in `work`; a card or the folder of a sweep that is given is not made.
    ValueError where the checkout's raw data or examples are not there."""
    if missing := [place for place in (DATA, EXAMPLES) if not place.is_dir()]:
        raise ValueError(f"{missing[0]}: no such folder. The paper's report is made from the checkout's raw data and "
                         "examples; clone the repository and run it there.")
    made = {} if card is not None else {CARD: _card(work)}
    card_file = card or work / CARD / "card.json"
    folder = sweep or work / SWEEP
    made |= {CYCLES: _cycles(work)} | _touches(work, card_file) | {CONVERGENCE: _convergence(work, card_file)}
    if sweep is None:
        made[SWEEP] = _sweep(work, setting, card_file, workers)
    made[NETWORKS] = _trained(work, NETWORKS, folder, workers, ("--method", "trainbr", "--epochs", str(setting.epochs)))
    made[FORWARD] = _trained(work, FORWARD, folder, workers, ("--method", "forward"))
    made[FOLLOWED] = _own(work, FOLLOWED, "followed.csv", (work / CHOICES,), (work / NETWORKS, work / FORWARD),
                          code_hash(("surrogate.cli.main",)))
    return Run(setting, made, card_file, folder, sweep is not None)


def _card(work: Path) -> Stage:
    files = [DATA / name for name in ("mts_uniaxial.txt", "mts_shear.txt", "mts_relaxation.txt")]
    skin = [DATA / "mts_stretch.txt", DATA / "nova_stretch.txt"]
    return Stage(CARD, work / CARD, ("matcal", "fit", *files, _pair(*skin), "--specimen", DATA / "specimen.toml",
                                     "--posterior", "--seed", SEED, "--out", work / CARD / "card.json"),
                 (*files, *skin, DATA / "specimen.toml"), code_hash(("matcal.cli.main",)))


def _pair(frame: Path, potentiostat: Path) -> Path:
    """The argument of a test that two machines wrote, whose last name stands for it in keys."""
    return Path(f"conductivity={frame},{potentiostat}")


def _cycles(work: Path) -> Stage:
    skin = [DATA / "mts_cyclic.txt", DATA / "nova_cyclic.txt"]
    return Stage(CYCLES, work / CYCLES, ("matcal", "fit", _pair(*skin), "--specimen", DATA / "specimen.toml", "--seed",
                                         SEED, "--out", work / CYCLES / "card.json"),
                 (*skin, DATA / "specimen.toml"), code_hash(("matcal.cli.main",)))


def _touches(work: Path, card: Path) -> dict[str, Stage]:
    """Single touches: the one of figures 10 and 11, two of the sweep's, three holds, and the open choices."""
    skin = ("--skin-patterns", "0,4")
    force, depth, loaded = HOLDS.values()
    return {TOUCH: _touch(work, TOUCH, EXAMPLES / "scene.toml", card, skin),
            FIRST: _touch(work, FIRST, work / "scenes" / "first.toml", card, skin),
            SECOND: _touch(work, SECOND, work / "scenes" / "second.toml", card, skin),
            **{name: _touch(work, name, SCENES / f"{name}.toml", card) for name in (force, depth)},
            LOADING: _own(work, LOADING, f"{loaded}.toml", (SCENES / f"{depth}.toml", card), (), _solvers(), PUBLISHED),
            loaded: _touch(work, loaded, work / LOADING / f"{loaded}.toml", card),
            CHOICES: _choices(work, card)}


def _touch(work: Path, name: str, scene: Path, card: Path, skin: tuple[str, ...] = ()) -> Stage:
    folder = work / name
    maps = ("--skin", folder / "skin.vtu", *skin) if skin else ()
    return Stage(name, folder, ("eitsim", "run", scene, "--card", card, "--out", folder / "touch.json", *maps),
                 (scene, card), code_hash(("eitsim.cli.main",)))


def _choices(work: Path, card: Path) -> Stage:
    design = SCENES / "choices.toml"
    return Stage(CHOICES, work / CHOICES, ("eitsim", "sweep", design, "--card", card, "--out", work / CHOICES),
                 (design, card), code_hash(), goes_on=True, extra=("--workers", "1"))


def _convergence(work: Path, card: Path) -> Stage:
    return _own(work, CONVERGENCE, "convergence.csv", (EXAMPLES / "scene.toml", card), (), _solvers())


def _solvers() -> str:
    return code_hash(("eitsim.cli.main",))


def _own(work: Path, name: str, out: str, inputs: tuple[Path, ...], more: tuple[Path, ...], code: str,
         *read: Path) -> Stage:
    """The stage of a module of this room that is called as the stage is: `inputs`, the file to write, `more` inputs;
    what it reads besides these is `read`."""
    own = source(Path(__file__).with_name(f"{name}.py")).sha256
    return Stage(name, work / name, (f"benchmarks.paper.{name}", *inputs, work / name / out, *more),
                 (*inputs, *more, *read), code + own)


def _sweep(work: Path, setting: Setting, card: Path, workers: int) -> Stage:
    design = EXAMPLES / "paper.toml"
    return Stage(SWEEP, work / SWEEP, ("eitsim", "sweep", design, "--card", card, "--scenes", str(setting.scenes),
                                       "--out", work / SWEEP),
                 (design, card), code_hash(), goes_on=True, extra=("--workers", str(workers)))


def _trained(work: Path, name: str, data: Path, workers: int, method: tuple[str, ...]) -> Stage:
    return Stage(name, work / name, ("surrogate", "train", data, "--out", work / name, *method, "--seed", SEED),
                 (data,), code_hash(("surrogate.cli.main",)), extra=("--workers", str(workers)))


def write_scenes(work: Path) -> None:
    """Write the first two scenes of the paper's sweep as scene files."""
    design = read_design(EXAMPLES / "paper.toml")
    (work / "scenes").mkdir(parents=True, exist_ok=True)
    for index, name in enumerate(("first", "second")):
        (punch,) = tables_at(design, index)["punch"]
        lines = [f"{key} = {float(value)!r}" for key, value in punch.items()]  # TOML reads them back exactly
        text = "\n".join([f"# scene {index} of examples/paper.toml", "[punch]", *lines, ""])
        (work / "scenes" / f"{name}.toml").write_text(text, encoding="utf-8")


def stale(run: Run) -> dict[str, str]:
    """Name of each stage whose results are there but not made from what lies there now -> what changed, in words."""
    said = {name: "command, inputs, code or files changed since. Run the report again without --draw-only."
            for name, stage in run.stages.items() if state(stage) == "stale"}
    if run.given_sweep and (why := _differs(run)):
        said[SWEEP] = f"as it was given, {why}."
    return said


def _differs(run: Run) -> str:
    """What a given sweep was made with other than what lies there now; empty where all agrees."""
    manifest = read_manifest(run.sweep)
    found = []
    if run.card.is_file() and (manifest.get("card") or {}).get("sha256") != card_identity(
            read_card(run.card))["sha256"]:
        found.append("it was made with another card")
    found += [words] if (words := other_code(manifest)) else []
    return " and ".join(found)
