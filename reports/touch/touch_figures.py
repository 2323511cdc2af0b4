"""Figures of one touch: the sensor from above, and the deformed surface along the radius."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from eitsim.scene.scene import Punch, rim_gap_m, scene_from
from reports.document import style
from reports.document.numerals import number
from reports.document.page import ReportFigure
from reports.touch.sensor_drawing import draw_sensor
from touchcal.arrays import Array


def sensor(axes: Axes, body: Mapping[str, Any], electrodes: Mapping[str, Any]) -> None:
    """Skin and electrodes from above, to scale, electrode numbers from 0; missing ones in grey. Tables as in a scene
    file."""
    draw_sensor(axes, scene_from({"body": body, "electrodes": electrodes}))


def scene(tables: Mapping[str, Any]) -> ReportFigure:
    """The sensor and the punches from above, to scale; `tables` as in a scene file."""
    body = scene_from({name: tables[name] for name in ("body", "electrodes")}).body
    figure = style.sheet(74, 80)
    axes = figure.subplots()
    sensor(axes, tables["body"], tables["electrodes"])
    gaps = []
    for punch in tables["punch"]:
        axes.add_patch(Circle((punch["x_mm"], punch["y_mm"]), punch["diameter_mm"] / 2, facecolor=style.ACCENT,
                              edgecolor="none", alpha=0.85))
        gaps.append(1e3 * rim_gap_m(body, Punch(punch["x_mm"] / 1e3, punch["y_mm"] / 1e3, punch["diameter_mm"] / 1e3)))
        if len(tables["punch"]) > 1:
            axes.text(punch["x_mm"], punch["y_mm"], str(len(gaps)), ha="center", va="center", fontsize=7)
    count = tables["electrodes"]["count"]
    caption = (f"The sensor from above, to scale, with {count} numbered electrodes and {_punches(tables['punch'])}; "
               f"{'its edge' if len(gaps) == 1 else 'the nearest edge'} is {number(min(gaps))} mm from "
               f"{body.edge.name}.")
    return ReportFigure("scene", figure, caption, {"scene": pd.DataFrame(tables["punch"])})


def _punches(punches: Sequence[Mapping[str, Any]]) -> str:
    placed = [f"{number(punch['diameter_mm'])} mm at x = {number(punch['x_mm'])} mm, y = {number(punch['y_mm'])} mm"
              for punch in punches]
    if len(placed) == 1:
        return f"the punch of {placed[0]}"
    return "the punches " + ", ".join(f"{i} of {place}" for i, place in enumerate(placed, 1))


def profile(block: Mapping[str, Sequence[float]], index: int, count: int, alone: bool,
            means: bool = False) -> ReportFigure:
    """Displacement, pressure and stretches of the surface along the radius from the axis of punch `index`; `alone`:
    the rim or a neighbour changes them, which these values do not hold."""
    fields = {name: np.asarray(values, dtype=float) for name, values in block.items()}
    r = fields["radius_mm"]
    figure = style.sheet(84)
    up, middle, down = figure.subplots(3, 1, sharex=True)
    up.plot(r, fields["u_z_mm"], color=style.ACCENT, label="vertical")
    up.plot(r, fields["u_r_mm"], color=style.SECOND, ls="--", label="radial")
    style.label(up, "", "Displacement (mm)")
    middle.plot(r, fields["pressure_kPa"], color=style.ACCENT, drawstyle="steps-mid")
    style.label(middle, "", "Pressure (kPa)")
    stretches = {"stretch_normal": "through the thickness", "stretch_meridian": "along the radius",
                 "stretch_hoop": "around the axis"}
    for (name, text), colour, dash in zip(stretches.items(), style.SERIES, style.DASHES, strict=False):
        down.plot(r, fields[name], color=colour, ls=dash, label=text)
    style.label(down, "Radius from the punch axis, undeformed (mm)", "Stretch (–)")
    up.legend(loc="lower right", ncols=2)
    down.legend(loc="lower right")
    reach = _reach(r, fields["u_z_mm"])
    down.set_xlim(0, reach)
    name = "profile" if count == 1 else f"profile_{index + 1}"
    caption = _profile_caption(fields, reach, index, count, alone, means)
    return ReportFigure(name, figure, caption, {name: pd.DataFrame(fields)})


def _reach(r: Array, u_z: Array) -> float:
    """Radius from which the surface moves less than 0.5 % of its largest displacement, with a margin."""
    return float(min(1.25 * _last_above(r, u_z, 0.005), r[-1]))


def _last_above(r: Array, u_z: Array, fraction: float) -> float:
    """Largest radius where |u_z| exceeds this fraction of its maximum; the whole range where nothing moves."""
    above = np.flatnonzero(np.abs(u_z) > fraction * np.abs(u_z).max())
    return float(r[above[-1]]) if above.size else float(r[-1])


def _profile_caption(fields: Mapping[str, Array], reach: float, index: int, count: int, alone: bool,
                     means: bool) -> str:
    r, u_z, pressure, normal = (fields[k] for k in ("radius_mm", "u_z_mm", "pressure_kPa", "stretch_normal"))
    which = "" if count == 1 else f"Touch {index + 1}. "
    if means:
        which += ("Means over the directions about the punch of what was solved in three dimensions; the pressure is "
                  "the mean one of the contact, the table holds its peak. ")
    elif alone:
        which += "The touch alone, without what edges or another touch change; the table holds that. "
    peak, least = int(np.argmax(pressure)), int(np.argmin(normal))
    highest = "" if means else (
        f" Contact pressure peaks at {number(pressure[peak])} kPa, {number(r[peak])} mm from the axis.")
    return (f"{which}The surface sinks by up to {number(-u_z.min())} mm; farther than "
            f"{number(_last_above(r, u_z, 0.01))} mm from the axis it moves by less than 1 % of that.{highest} The "
            f"least stretch through the thickness, {number(normal[least])}, lies at {number(r[least])} mm. Drawn to "
            f"{number(reach)} mm.")
