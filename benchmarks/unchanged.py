"""Numbers that a change of structure must leave as they were, to the last bit: cards, touches, sweep rows, predictions.

Usage: unchanged.py save FILE [PART ...] before, unchanged.py compare FILE [PART ...] after, on one machine. PART: card,
touch, sweep, reader, recording; all without one. Each number is kept as the hash of what the commands wrote, without
times and versions. Some CPU minutes; no table of results.
"""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parent.parent
DISC = "[punch]\nx_mm = {x}\ny_mm = 5\ndiameter_mm = 14\nforce_N = 0.8\n"
RECTANGLE = '[body]\noutline = "rectangle"\nwidth_mm = 150\nheight_mm = 110\n'
TWO = "[[punch]]\nx_mm = -{a}\nforce_N = 0.5\n[[punch]]\nx_mm = {a}\nprofile = \"sphere\"\nforce_N = 0.6\n"
SCENES = {
    "axisymmetric": DISC.format(x=20), "near_rim": DISC.format(x=85), "whole_disc": "[body]\nradius_mm = 30\n"
    + DISC.format(x=14), "depth": DISC.format(x=10).replace("force_N = 0.8", "depth_mm = 2"),
    "stick": DISC.format(x=10) + 'friction = "stick"\n',
    "coulomb": DISC.format(x=10) + 'friction = "coulomb"\nfriction_coefficient = 0.4\n',
    "sphere": DISC.format(x=10) + 'profile = "sphere"\n', "ellipse": DISC.format(x=10) + 'profile = "ellipse"\n',
    "conductor": DISC.format(x=10) + "conductor = true\ncontact_impedance_Ohm_m2 = 1e-4\n",
    "far_pair": TWO.format(a=30), "close_pair": TWO.format(a=11),
    "held": DISC.format(x=10) + "[hold]\ntime_s = [2, 60]\nloading_s = 1.0\n",
    "areal": DISC.format(x=10) + '[skin]\nstrain = "areal"\n',
    "patches": DISC.format(x=10) + '[electrodes]\nkind = "patch"\nlength_mm = 5.0\ncontact_impedance_Ohm_m2 = 1e-4\n',
    "rectangle": RECTANGLE + DISC.format(x=20), "rectangle_edge": RECTANGLE + DISC.format(x=66),
    "hole": RECTANGLE + "holes_mm = [[-30, 0, 6]]\n" + DISC.format(x=-12),
    "surface": RECTANGLE + DISC.format(x=20) + '[electrodes]\nkind = "surface"\ncount = 6\n'
    "x_mm = [-45, -15, 45, 45, -15, -45]\ny_mm = [-30, -30, -30, 30, 30, 30]\nwidth_mm = 4.0\n"
    "contact_impedance_Ohm_m2 = 1e-4\n", "exact": DISC.format(x=20)}
SWEEPS = {"inside": "[punch]\nplace = { within_mm = 45 }\ndiameter_mm = [10, 18]\nforce_N = [0.1, 2.0]\n",
          "anywhere": "[punch]\ndiameter_mm = 14\nforce_N = [0.2, 1.2]\n",
          "two": "touches = 2\n[punch]\nplace = { within_mm = 45, apart_mm = 30 }\nforce_N = [0.2, 1]\n",
          "drawn": "[punch]\nplace = { within_mm = 45 }\nforce_N = [0.2, 1]\n[material]\ndraws = 3\n",
          "rectangle": RECTANGLE + "[punch]\ndiameter_mm = 12\nforce_N = [0.2, 1]\n"}
# what differs from run to run, wherever it stands
VOLATILE = {"cost", "versions", "code", "cpu_s", "wall_s", "peak_MB", "created", "date", "elapsed_s", "seconds", "time"}
Hashes = dict[str, str]


def ran(folder: Path, *command: str | Path) -> None:
    """A command of this checkout, in a cache of its own; a refusal is a result."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(folder / "cache")}
    done = subprocess.run([sys.executable, "-m", str(command[0]), *map(str, command[1:])], cwd=ROOT,
                          env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        (folder / "refusals").open("a").write(f"{' '.join(map(str, command))}\n{done.stderr}\n")


def hashed(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def steady(content: Any) -> Any:
    """What does not differ from run to run."""
    if isinstance(content, dict):
        return {key: steady(each) for key, each in content.items() if key not in VOLATILE}
    return [steady(each) for each in content] if isinstance(content, list) else content


def of_json(path: Path, *left_out: str) -> str:
    if not path.exists():
        return "nothing was written"
    found = steady(json.loads(path.read_text(encoding="utf-8")))
    return hashed({key: each for key, each in found.items() if key not in left_out})


def of_table(table: pd.DataFrame) -> str:
    kept = table.select_dtypes("number").loc[:, lambda t: [not any(word in name for word in VOLATILE) for name in t]]
    return hashlib.sha256(np.ascontiguousarray(kept.to_numpy(float)).tobytes()).hexdigest()[:16]


def card_of(folder: Path) -> Path:
    path, data = folder / "card.json", ROOT / "data_raw"
    if not path.exists():
        ran(folder, "matcal", "fit", *(data / f"mts_{name}.txt" for name in ("uniaxial", "shear", "relaxation")),
            f"conductivity={data}/mts_stretch.txt,{data}/nova_stretch.txt", "--specimen", data / "specimen.toml",
            "--posterior", "--seed", "1", "--out", path)
    return path


def cards(folder: Path) -> Hashes:
    csv, data = folder / "csv.json", ROOT / "data_raw"
    ran(folder, "matcal", "fit", data / "uniaxial.csv", data / "shear.csv", "--out", csv)
    whole = json.loads(card_of(folder).read_text(encoding="utf-8"))
    laws = {key: whole[key] for key in ("hyperfoam", "prony", "conductivity", "stability", "posterior")}
    return {"machine": hashed(steady(laws)), "csv": of_json(csv, "provenance", "data"),
            "draws": of_json(folder / "card.json", "provenance", "data", "fit")}


def touches(folder: Path) -> Hashes:
    card, found = card_of(folder), {}
    for name, scene in SCENES.items():
        (folder / f"{name}.toml").write_text(scene, encoding="utf-8")
        ran(folder, "eitsim", "run", folder / f"{name}.toml", "--card", card, "--out", folder / f"{name}.json",
            *(["--exact"] if name == "exact" else []))
        found[name] = of_json(folder / f"{name}.json", "plan", "card", "schema")
    return found


def swept(folder: Path, name: str, scenes: int) -> Path:
    out = folder / f"sweep_{name}"
    if not out.exists():
        (folder / f"{name}.toml").write_text(f"scenes = {scenes}\nseed = 1\n{SWEEPS[name]}", encoding="utf-8")
        ran(folder, "eitsim", "sweep", folder / f"{name}.toml", "--card", card_of(folder), "--out", out,
            "--workers", "1")
    return out


def rows(out: Path) -> pd.DataFrame:
    parts = sorted(out.glob("part-*.parquet"))
    return pd.concat([pd.read_parquet(part) for part in parts], ignore_index=True) if parts else pd.DataFrame()


def sweeps(folder: Path) -> Hashes:
    return {name: of_table(rows(swept(folder, name, 60 if name == "inside" else 6))) for name in SWEEPS}


def voltages(folder: Path) -> pd.DataFrame:
    return rows(swept(folder, "inside", 60)).filter(regex="^v_")


def readers(folder: Path) -> Hashes:
    """A model of each kind read on noisy frames of the sweep."""
    volts, rng, found = voltages(folder), np.random.default_rng(1), {}
    dv = rows(folder / "sweep_inside").filter(regex="^dv_").to_numpy(float)
    base = volts.to_numpy(float)[0] - dv[0]
    frames = pd.DataFrame(np.vstack([np.tile(base, (20, 1)), volts.to_numpy(float)[:12]]), columns=volts.columns)
    frames += 1e-4 * np.abs(base).mean() * rng.normal(size=frames.shape)
    frames[:20].to_csv(folder / "untouched.csv", index=False)
    frames[20:].to_csv(folder / "frames.csv", index=False)
    for method in ("forward", "ridge", "gp", "trainbr"):
        model, out = folder / method, folder / f"{method}.csv"
        ran(folder, "surrogate", "train", folder / "sweep_inside", "--out", model, "--method", method, "--seed", "1",
            *(["--epochs", "5"] if method == "trainbr" else []))
        ran(folder, "surrogate", "predict", model, folder / "frames.csv", "--baseline", folder / "untouched.csv",
            "--out", out)
        found[method] = of_table(pd.read_csv(out)) if out.exists() else "nothing was written"
    return found


def recordings(folder: Path) -> Hashes:
    """A reader of recorded presses: the sweep's touches as a synthetic recording, an untouched frame before each."""
    volts, rng = voltages(folder).to_numpy(float), np.random.default_rng(2)
    table = rows(folder / "sweep_inside")
    base = volts[0] - table.filter(regex="^dv_").to_numpy(float)[0]
    frames = np.stack([np.tile(base, (len(volts), 1)), volts], axis=1).reshape(-1, volts.shape[1])
    frames = frames + 1e-4 * np.abs(base).mean() * rng.normal(size=frames.shape)
    out = pd.DataFrame(frames, columns=[f"v_{k:03d}" for k in range(frames.shape[1])])
    out.insert(0, "touch", [name for k in range(len(volts)) for name in ("", str(k))])
    out.to_csv(folder / "recording.csv", index=False)
    table[["x_mm", "y_mm", "F_N"]].rename_axis("touch").reset_index().to_csv(folder / "labels.csv", index=False)
    ran(folder, "surrogate", "train", folder / "recording.csv", "--labels", folder / "labels.csv", "--out",
        folder / "recorded", "--seed", "1")
    ran(folder, "surrogate", "predict", folder / "recorded", folder / "recording.csv", "--out", folder / "recorded.csv")
    path = folder / "recorded.csv"
    return {"reader": of_table(pd.read_csv(path)) if path.exists() else "nothing was written"}


PARTS: dict[str, Callable[[Path], Hashes]] = {"card": cards, "touch": touches, "sweep": sweeps, "reader": readers,
                                              "recording": recordings}


def main() -> None:
    if len(sys.argv) < 3 or sys.argv[1] not in ("save", "compare") or not set(sys.argv[3:]) <= set(PARTS):
        raise SystemExit(f"unchanged.py: give save or compare, a file, and any of {', '.join(PARTS)}.")
    file, names = Path(sys.argv[2]), sys.argv[3:] or list(PARTS)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        found = {f"{part}: {name}": each for part in names for name, each in PARTS[part](folder).items()}
        refusals = folder / "refusals"
        print(refusals.read_text() if refusals.exists() else "no command failed")
    if sys.argv[1] == "save":
        file.write_text(json.dumps(found, indent=1), encoding="utf-8")
        return
    before = json.loads(file.read_text(encoding="utf-8"))
    changed = [name for name, each in found.items() if before.get(name) != each]
    print("\n".join(f"changed  {name}" for name in changed) or f"all {len(found)} as before")
    sys.exit(bool(changed))


if __name__ == "__main__":
    main()
