"""The account of a data set on a page: cost by stage, errors against the requested ones, what the plans left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reports.document.numerals import counted, number, percent, typeset
from reports.document.page import Table

if TYPE_CHECKING:
    from eitsim.sweeps.run.account import Accounted
    from eitsim.sweeps.run.omissions import Omission

_MOST = 5  # decisions shown with their bound


def stage_table(account: Accounted) -> Table:
    """CPU time by stage."""
    whole = account.cpu_s
    rows = [[stage.name, str(stage.count), number(stage.cpu_s), percent(stage.cpu_s / whole) if whole else ""]
            for stage in account.stages]
    rate = account.rows_per_core_hour
    caption = f"Cost by stage: {number(whole)} CPU s in all"
    caption += "" if rate is None else f"; tables not counted, {number(rate)} rows per core-hour"
    caption += f", {number(account.bytes_per_row / 1e3)} kB a row on disk"
    caption += f" and {number(account.field_bytes_per_row / 1e3)} kB of fields." if account.field_bytes_per_row else "."
    return Table(caption, ["stage", "count", "CPU (s)", "share"], rows, "wrrr")


def findings(account: Accounted) -> list[str]:
    """Errors against the requested ones, and how busy the workers were."""
    said = []
    if (errors := account.errors) is not None:
        requested = "the one requested" if errors.requested is None else f"the {percent(errors.requested)} requested"
        said.append(f"The estimated relative error of the signal is {percent(errors.median)} in the median scene, 95 % "
                    f"of scenes lie below {percent(errors.p95)}, the worst has {percent(errors.largest)}; "
                    f"{percent(errors.share_above)} of the scenes are above {requested}.")
    for run in account.runs[-1:]:
        by = "lent workers" if run.workers is None else counted(run.workers, "worker")
        busy = "" if run.efficiency is None else f", which were busy with them {percent(run.efficiency)} of the time"
        runs = f" The last of {len(account.runs)} runs" if len(account.runs) > 1 else " The run"
        said.append(f"{run.method[:1].upper()}{run.method[1:]}.{runs} made "
                    f"{counted(run.rows, 'scene')} in {number(run.rows_wall_s)} s on {by}{busy}.")
    return said


def left_out(account: Accounted) -> list[str]:
    """What the plans of the rows leave out: bounds first, then what is unknown."""
    bounded = [one for one in account.left_out if not one.unbounded][:_MOST]
    unknown = [one.decision for one in account.left_out if one.unbounded]
    said = [_bound(one) for one in bounded]
    if unknown:
        said.append(f"At a cost that is unknown and in no error: {'; '.join(unknown)}.")
    return [*map(typeset, said)]


def _bound(one: Omission) -> str:
    share = "" if one.rows == one.of else f" (in {one.rows} of the {one.of} scenes looked at)"
    return f"{one.decision[:1].upper()}{one.decision[1:]}{share}: at most {percent(one.error_bound)} of the signal."
