"""`surrogate limit`: how well readings with white noise can tell a touch, whatever reads them."""

from pathlib import Path
from typing import Annotated, Any

import typer

from touchcal.terminal import JsonOption, check_apart, check_out, counted, numbers, print_json, waiting

DATA_HELP = "Data set: the least root mean square error over its touches."
NOISE_HELP = "Noise levels in dB below the RMS of the baseline voltages, separated by commas."
MATERIAL_HELP = "Count what the card's posterior leaves open, too."
RIM_HELP = "Of one touch: count what the rim changes of the mechanics."
MAP_HELP = "Of one touch: the limit of its punch anywhere on the skin, in some 50 CPU seconds; on an outline 70."
OUT_HELP = "CSV to write; as MODEL_DIR/limits.csv (of a data set) or limit_map.csv (of a map) reports show it."


def limit(card: Annotated[Path, typer.Argument(metavar="CARD", help="Card of the foam and the skin.")],
          data: Annotated[Path | None, typer.Option(help=DATA_HELP)] = None,
          scene: Annotated[Path | None, typer.Option(help="Scene of one touch: the limit there.")] = None,
          noise_db: Annotated[str, typer.Option(help=NOISE_HELP)] = "80,60",
          material: Annotated[bool, typer.Option("--material", help=MATERIAL_HELP)] = False,
          rim: Annotated[bool, typer.Option("--rim", help=RIM_HELP)] = False,
          over_disc: Annotated[bool, typer.Option("--map", help=MAP_HELP)] = False,
          out: Annotated[Path | None, typer.Option(help=OUT_HELP)] = None, as_json: JsonOption = False) -> None:
    """Find the physical limit of x0, y0, d and F under noise; of a data set that of the mechanical outputs, too.

    Example: surrogate limit card.json --data sweep --noise-db 80,60 --material --out model/limits.csv
    """
    import pandas as pd

    if (data is None) == (scene is None):
        raise ValueError("give either --data DIR, for the least error over its touches, or --scene FILE, for the limit "
                         "at one touch.")
    for given, name in ((rim, "--rim"), (over_disc, "--map")):
        if given and scene is None:
            raise ValueError(f"{name} is for one touch; give --scene, or leave it out.")
    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [card, *([scene] if scene is not None else [])])
    levels = numbers(noise_db, "--noise-db", "80,60")
    if data is not None:
        rows, title = _of_data(data, card, levels, material), "least RMS error over the prior"
    else:
        assert scene is not None
        rows = _of_scene(scene, card, levels, material, rim, over_disc)
        title = "standard deviation over the skin" if over_disc else "standard deviation at this touch"
    if out is not None:
        pd.DataFrame(rows).to_csv(out, index=False, float_format="%.6g")
    if as_json:
        print_json({"card": card, "limits": rows})
    else:
        _print(_ends(rows) if over_disc else rows, title)
        if out is not None:
            print(f"limits: {out}")


def _of_data(folder: Path, card: Path, levels: list[float], material: bool) -> list[dict[str, Any]]:
    from surrogate.bounds.dataset_bound import floors
    from surrogate.data import outputs

    found = floors(folder, card, levels, material=material, each=counted("touches"))
    return [{"dataset": one.dataset, "noise_db": one.noise_db, "noise_V": one.noise_V, "material": which,
             "output": name, "unit": outputs.of(name).unit, "limit": value}
            for one in found for which, values in (("known", one.known), ("posterior", one.material))
            for name, value in values.items()]


def _of_scene(path: Path, card_path: Path, levels: list[float], material: bool, rim: bool,
              everywhere: bool) -> list[dict[str, Any]]:
    from eitsim.scene.scene import read_scene
    from matcal.card import read_card
    from surrogate.bounds.cramer_rao import cramer_rao, over_disc
    from surrogate.bounds.material_spread import known_material, spread_of

    card = read_card(card_path)
    spreads = {"known": known_material()} | ({"posterior": spread_of(card, card_path)} if material else {})
    scene = read_scene(path)
    with waiting("solving the touch"):
        found = (over_disc(scene, card, spreads, levels, rim=rim, each=counted("touches")) if everywhere
                 else cramer_rao(scene, card, levels, spreads, rim=rim))
    return found.to_dict("records")


def _ends(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Of a map the value at the centre, its first row, the least and the largest, as rows that can be printed."""
    from surrogate.data import outputs

    found = []
    for level, material in dict.fromkeys((row["noise_db"], row["material"]) for row in rows):
        part = [row for row in rows if (row["noise_db"], row["material"]) == (level, material)]
        for name in outputs.TOUCHES:
            unit = outputs.of(name).unit
            each = [row[f"sd_{name}_{unit}"] for row in part]
            found += [{"noise_db": level, "material": material, "output": f"{name}, {word}", "unit": unit,
                       "limit": value} for word, value in (("centre", each[0]), ("least", min(each)),
                                                           ("largest", max(each)))]
    return found


def _print(rows: list[dict[str, Any]], title: str) -> None:
    from rich.console import Console
    from rich.table import Table

    materials = list(dict.fromkeys(row["material"] for row in rows))
    table = Table("noise, dB", "output", "unit", *(f"material {name}" for name in materials), title=title)
    by_line: dict[tuple[float, str, str], dict[str, float]] = {}
    for row in rows:
        by_line.setdefault((row["noise_db"], row["output"], row["unit"]), {})[row["material"]] = row["limit"]
    for (level, output, unit), values in by_line.items():
        table.add_row(f"{level:g}", output, unit, *(f"{values[m]:.4g}" if m in values else "-" for m in materials))
    Console().print(table)


