"""The card of a layer that was pressed, with its draws next to it."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from eitsim.presses.identify import Identified
from matcal.card import MaterialCard, write_card
from matcal.laws.stability import stability
from matcal.posterior.draws import FILE, write_draws
from matcal.record.write import check_place, folder_of


def layer_card(found: Identified, start: MaterialCard, files: Sequence[Path] = ()) -> MaterialCard:
    """The card of the law found, its intervals those of the draws; how it relaxes and its skin are the start's."""
    model = found.model
    depth = max(float(one.press.depth_m[-1]) for one in model.near) / model.setup.thickness_m
    law = replace(found.law, strain_range={"uniaxial": (-depth, 0.0)})
    rest = ", ".join(f"{name} {row['value']:.4g} ({row['lo']:.4g} to {row['hi']:.4g})"
                     for name, row in found.nuisances.items())
    decisions = [f"{law.name} of {len(model.near)} presses of a layer of {1e3 * model.setup.thickness_m:g} mm, from "
                 f"card '{start.name}'; known before: {model.prior.words}", f"not the law's: {rest}"]
    if "nu" in {p.name for p in law.parameters}:
        decisions.append("nu is that of the start; presses were not asked for it")
    provenance = {"files": [{"name": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
                            for path in files], "date": datetime.now(UTC).isoformat(timespec="seconds"),
                  "decisions": decisions, "cpu_s": {"presses": found.cpu_s},
                  "synthetic": bool(start.provenance.get("synthetic", False))}
    fit = {"derived": {name: {key: row[key] for key in ("value", "sd", "lo", "hi")}
                       for name, row in found.derived.items()}, "not_determined": list(found.not_determined)}
    return MaterialCard("layer", law, start.prony, start.conductivity, fit=fit, stability=stability(law),
                        provenance=provenance, shift=start.shift, softening=start.softening,
                        posterior={"n": len(found.draws), "checks": {"converged": found.converged}})


def write_layer_card(card: MaterialCard, found: Identified, out: Path) -> MaterialCard:
    """Write the card and, in the folder next to it, its draws; ValueError where that would replace other files."""
    check_place(out)
    folder = folder_of(out)
    folder.mkdir(exist_ok=True)
    write_draws(found.draws, folder / FILE, {}, about={"presses": len(found.model.near)})
    card = replace(card, name=out.stem, data=folder.name, file=out,
                   posterior={"file": f"{folder.name}/{FILE}", **card.posterior})
    write_card(card, out)
    return card
