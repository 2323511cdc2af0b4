"""`eitsim identify`: the law of a layer from force against depth of one or several punches."""

from pathlib import Path
from typing import Annotated

import typer

from touchcal.errors import NotConverged
from touchcal.number_words import percent, within
from touchcal.terminal import JsonOption, check_apart, check_out, print_json, waiting

_NOT_FOLLOWED = 0.1  # share of the force that a law leaves from which on its kind is doubted


def identify(presses: Annotated[list[Path], typer.Argument(metavar="PRESSES", help=(
                 "CSV of depth_mm and F_N, and `press` where there are several; one file a punch."))],
             punch: Annotated[list[str], typer.Option(help=(
                 "The punch of each file in its order: profile, diameter and fillet in mm, as \"flat 14 0.5\"."))],
             thickness_mm: Annotated[float, typer.Option("--thickness-mm", "--thickness", help=(
                 "Thickness of the layer, which is bonded to a rigid plate."))],
             card: Annotated[Path, typer.Option(help=(
                 "Card whose law is sought and from where: its draws, where it has some, are what is known before."))],
             out: Annotated[Path | None, typer.Option(help="Write the card here, its draws next to it.")] = None,
             tolerance: Annotated[float, typer.Option("--thickness-tolerance", help=(
                 "Largest relative error of the thickness."))] = 0.03,
             friction: Annotated[str, typer.Option(help="Least and largest friction.")] = "0,1",
             contact_mm: Annotated[float, typer.Option("--contact-mm", help=(
                 "Largest error of the depth at which a press begins to touch."))] = 0.1,
             force_error: Annotated[float, typer.Option(help="Relative error of the load cell.")] = 0.005,
             compliance: Annotated[float, typer.Option("--compliance-mm-per-N", help=(
                 "About how far the machine gives way."))] = 0.002,
             seed: Annotated[int, typer.Option(min=0, help="Seed of the draws.")] = 0,
             as_json: JsonOption = False) -> None:
    """Find the law of a foam or rubber layer from presses with a force gauge, with what they leave open, and say which
    punch to press next. Takes about a minute.

    Example: eitsim identify flat.csv round.csv --punch "flat 14" --punch "sphere 14" --thickness-mm 10
    --card start.json
    """
    from eitsim.presses.identify import identify as identified
    from eitsim.presses.layer_card import layer_card, write_layer_card
    from eitsim.presses.next_press import next_presses
    from eitsim.presses.press_file import punch_of, read_presses
    from eitsim.presses.press_model import PressSetup
    from matcal.card import read_card
    from touchcal.terminal import numbers

    if len(punch) != len(presses):
        raise ValueError(f"{len(presses)} files and {len(punch)} --punch are given; give each file its punch, in "
                         "order.")
    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [*presses, card])
    ends = numbers(friction, "--friction", "0,0.6")
    if len(ends) != 2 or not 0 <= ends[0] < ends[1]:
        raise ValueError(f"--friction {friction}: write the least and the largest, as 0,0.6.")
    setup = PressSetup(thickness_mm / 1e3, tolerance, (ends[0], ends[1]), contact_mm / 1e3, force_error,
                       compliance / 1e3)
    start = read_card(card)
    read = [one for path, words in zip(presses, punch, strict=True) for one in read_presses(path, punch_of(words))]
    with waiting("pressing layers"):
        found = identified(read, setup, start, seed=seed)
        further = next_presses(found)
    made = layer_card(found, start, presses)
    if out is not None:
        made = write_layer_card(made, found, out)
    if as_json:
        print_json({"derived": found.derived, "nuisances": found.nuisances,
                    "not_determined": list(found.not_determined), "converged": found.converged, "cpu_s": found.cpu_s,
                    "misfit": found.misfit.tolist(), "next": [{
                        "profile": one.punch.profile, "diameter_mm": 1e3 * one.punch.diameter_m,
                        "depth_mm": 1e3 * one.depth_m, "force_N": one.force_N, "narrows_by": dict(one.narrows)}
                        for one in further]})
    else:
        from matcal.cli.summary import print_table
        from matcal.record import result_tables as tables

        print_table(tables.derived(made))
        rows = [[name, *within(row["value"], row["lo"], row["hi"]),
                 "not determined" if name in found.not_determined else ""] for name, row in found.nuisances.items()]
        print_table(tables.Printed("Not the law's", ["quantity", "value", "95 % interval", ""], rows, "<>><", [
            f"The law leaves {percent(float(found.misfit.max()), 2)} of the force, r.m.s. of the press that it fits "
            f"worst; {found.cpu_s:.0f} CPU s.", "nu is the start's; presses were not asked for it."]))
        if found.misfit.max() > _NOT_FOLLOWED:
            print("! A law of the start's kind does not follow these forces: trust no interval of it. A foam "
                  "takes a start with nu near 0, as examples/foam_start.json, a rubber one as "
                  "examples/rubber_start.json.")
        if further:
            print_table(tables.Printed(
                "Next press", ["punch", "to", "force", "narrows mu_0", "and plateau by"],
                [[f"{one.punch.profile} {1e3 * one.punch.diameter_m:g}", f"{1e3 * one.depth_m:.2g} mm",
                  f"{one.force_N:.2g} N", *(percent(share, 2) for share in one.narrows.values())]
                 for one in further[:3]], "<>>>>"))
        if out is not None:
            print(f"card: {out}")
    if not found.converged:
        raise NotConverged("forces of the law did not settle, or the draws are too few to trust. Give another start "
                           "(--card), with fewer terms.")
