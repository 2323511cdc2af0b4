"""The current through the thickness of a touched layer that conducts in its volume, and where the layer is a sheet."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from reports.document import style
from reports.document.numerals import number
from reports.document.page import ReportFigure


def layer(block: Mapping[str, Any], profile: Mapping[str, Sequence[float]], thickness_mm: float, index: int,
          count: int) -> ReportFigure:
    """Lines that part the current along the layer into tenths, under touch `index`, and by radius how uneven the
    potential is through the thickness."""
    radius, spread = np.asarray(block["radius_mm"]), np.asarray(block["spread"])
    r, z = np.asarray(block["lines_r_mm"]), np.asarray(block["lines_z_mm"])
    moved_r, moved_z = (np.asarray(profile[one]) + (np.asarray(profile["radius_mm"]) if one == "u_r_mm" else 0)
                        for one in ("u_r_mm", "u_z_mm"))
    figure = style.sheet(84)
    section, down = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    section.plot(moved_r, moved_z, color="black", lw=1)
    section.axhline(-thickness_mm, color="black", lw=1)
    for one, height in zip(r, z, strict=True):
        section.plot(one, height, color=style.ACCENT, lw=0.8)
    from_mm = float(block["sheet_from_mm"])
    for axes in (section, down):
        axes.axvline(from_mm, color=style.SECOND, ls="--", lw=0.8)
    style.label(section, "", "Height (mm)")
    down.semilogy(radius, np.maximum(100 * spread, 1e-4), color=style.ACCENT)
    style.label(down, "Radius from the punch axis (mm)", "Potential's range (%)")
    down.set_xlim(0, float(radius[-1]))
    name = "layer" if count == 1 else f"layer_{index + 1}"
    which = "" if count == 1 else f"Touch {index + 1}. "
    caption = (f"{which}Above, the section of the touched layer along a far, even current: between two lines flows a "
               "tenth of the current at that radius. Below, the range of the potential through the thickness over its "
               f"mean, by untouched radius. From {number(from_mm)} mm on, dashed, it is less than 1 %: no current "
               "crosses the layer, and its resultant is a sheet.")
    rows = {"radius_mm": radius, "potential_range": spread}
    rows |= {f"{part}_{k}0_percent_mm": one for part, lines in (("r", r), ("z", z)) for k, one in enumerate(lines, 1)}
    return ReportFigure(name, figure, caption, {name: pd.DataFrame(rows)})
