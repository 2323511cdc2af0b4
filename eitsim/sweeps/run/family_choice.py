"""Which tables of load paths serve a design whose rows have laws of their own, and when they are worth their cost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, astuple, replace
from typing import Any

import numpy as np

from eitsim.mechanics.load_paths.build_law_family import build_family, with_rim
from eitsim.mechanics.load_paths.build_table import Run
from eitsim.mechanics.load_paths.law_family import Family, places_among
from eitsim.mechanics.load_paths.load_path import Deviation
from eitsim.mechanics.load_paths.reduced_basis import ReducedBasis, reduced_basis
from eitsim.mechanics.load_paths.table import as_deep_as, of_law
from eitsim.mechanics.load_paths.types import DimensionlessProblem, Table
from eitsim.simulation import reuse
from eitsim.simulation.material import material_of
from eitsim.simulation.reuse import table_for
from eitsim.sweeps.design.card_draws import Cards
from eitsim.sweeps.design.design import Design, representative_scene
from eitsim.sweeps.run.table_choice import REPAYS, design_shape
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior.draws import card_of
from touchcal import cache

# Touches from which on the paths of another law repay their cost, for each of its diameters, and of each law that tells
# the error.
LAW_REPAYS, CHECK_REPAYS = 35, 30


def span_for(design: Design, cards: Cards) -> tuple[DimensionlessProblem, ReducedBasis]:
    """The shape of the central one of a design's laws, and the laws that span them, whatever the number of rows;
    ValueError where no load paths serve the design."""
    span = reduced_basis(list(_laws(design, cards)))
    return of_law(design_shape(design, cards.card), span.central), span


def _laws(design: Design, cards: Cards) -> Iterator[Hyperfoam]:
    """Laws of all cards that make a material, moduli as the scenes ask for."""
    scene, draws = representative_scene(design), cards.draws
    for k in range(len(cards.samples)):
        try:
            yield material_of(scene, card_of(draws, cards.card, k) if draws is not None else cards.card).law
        except ValueError:  # the rows of this card tell why
            continue


def family_repays(design: Design, shape: DimensionlessProblem, span: ReducedBasis) -> bool:
    """Whether solving a design's touches afresh costs more than tables for its laws."""
    solved = len(shape.solved)
    cost = REPAYS * solved + LAW_REPAYS * len(span.chosen) * len(places_among(solved))
    cost += CHECK_REPAYS * len(span.held_out)
    return design.scenes * len(representative_scene(design).punches) >= cost


def family_for(
    shape: DimensionlessProblem, span: ReducedBasis, run: Run = map, *, rim: bool = False
) -> tuple[Family, str]:
    """The family of a span's laws, from the cache or solved and put there; as reuse.table_for."""
    table, note = table_for(shape, run, rim=rim)
    key = {"shape": asdict(shape), "depths": reuse.DEPTHS,
           "laws": [_plain(law) for law in (span.central, *span.chosen)],
           "held_out": [_plain(law) for law in span.held_out]}
    alone = replace(table, rim=None)
    arrays, _ = cache.kept(cache.key_of(key), lambda: _arrays(build_family(alone, span, run)))
    family = _family(alone, span, arrays)
    if table.rim is None:
        return family, note
    key |= {"rim": asdict(reuse.GRID)}
    arrays, _ = cache.kept(cache.key_of(key), lambda: _rim_told(with_rim(family, table, run)))
    changes = replace(table.rim, error_estimate=np.asarray(arrays["told"]), cpu_s=float(arrays["cpu_s"]))
    return replace(family, table=replace(family.table, rim=changes)), note


def _plain(law: Hyperfoam) -> list[list[float]]:
    """A law's parameters as JSON holds them, moduli over mu_0."""
    return [(law.mu_Pa / law.mu_0_Pa).tolist(), law.alpha.tolist(), law.nu.tolist()]


def _arrays(family: Family) -> dict[str, Any]:
    table = family.table
    return {"values": family.values, "slopes": family.slopes, "count": np.array(len(table.depths)),
            "checks": np.array(table.checks), "error": np.array(astuple(table.error)), "cpu_s": np.array(table.cpu_s)}


def _rim_told(family: Family) -> dict[str, Any]:
    rim = family.table.rim
    assert rim is not None
    return {"told": rim.error_estimate, "cpu_s": np.array(rim.cpu_s)}


def _family(table: Table, span: ReducedBasis, arrays: Mapping[str, Any]) -> Family:
    table = replace(as_deep_as(table, int(arrays["count"])), error=Deviation(*arrays["error"].tolist()),
                    checks=int(arrays["checks"]), cpu_s=float(arrays["cpu_s"]))
    return Family(table, span, np.asarray(arrays["values"]), np.asarray(arrays["slopes"]))
