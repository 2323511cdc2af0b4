"""The loading time after which a touch kept at its depth loses what the paper states of its mean pressure (figure 9).

Run as `python -m benchmarks.paper.loading SCENE CARD OUT`, a stage of the paper's report: OUT is SCENE with that time.
"""

import functools
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import root_scalar

from benchmarks.paper.section import paper_value
from eitsim.mechanics.axisymmetric.hold import solve_hold
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.scene import Scene, read_scene
from eitsim.simulation.material import material_of
from matcal.card import MaterialCard, read_card
from matcal.laws.prony import Prony, convolve
from touchcal.errors import NotConverged

WITHIN_S = 2.0
LOST = "mean pressure lost in 2 s, hold at {}"
# loading times that are searched, s; relative accuracy of the one found; samples of a ramp
SHORTEST_S, LONGEST_S, ACCURACY, SAMPLES = 1e-3, 1e3, 3e-3, 400
COARSE = 2.0  # element size of the search over the default one; the share lost hardly depends on it


def lost_by_series(series: Prony, loading_s: float) -> float:
    """Fraction that a stress loses in WITHIN_S after it would have risen in proportion to time over `loading_s`."""
    rise = np.linspace(0.0, 1.0, SAMPLES)
    stress = convolve(series, np.append(loading_s * rise, loading_s + WITHIN_S), np.append(rise, 1.0))
    return float(1 - stress[-1] / stress[-2])


def lost_by_touch(scene: Scene, card: MaterialCard, loading_s: float) -> float:
    """Fraction of the mean contact pressure that a scene's touch loses in WITHIN_S after loading over `loading_s`."""
    material, (punch,) = material_of(scene, card), scene.punches
    hold = replace(scene.hold, time_s=(WITHIN_S,), loading_s=loading_s)
    (_, loaded), (_, later) = solve_hold(material.law, material.series, scene.body, punch, hold,
                                         element_m=COARSE * default_element_m(scene.body, punch))
    return 1 - later.sigma_ave_Pa / loaded.sigma_ave_Pa


def time_that_loses(fraction: float, lost: Callable[[float], float], near_s: tuple[float, float]) -> float:
    """The loading time, s, after which `lost` is a fraction; `lost` falls with it. The bracket `near_s` is widened to
    SHORTEST_S and LONGEST_S where it holds none; NotConverged where these hold none either."""
    lost = functools.cache(lost)
    for low, high in (near_s, (SHORTEST_S, LONGEST_S)):
        if lost(low) >= fraction >= lost(high):
            return root_scalar(lambda loading_s: lost(loading_s) - fraction, bracket=(low, high), rtol=ACCURACY).root
    raise NotConverged(f"no loading within {SHORTEST_S:g} to {LONGEST_S:g} s loses {100 * fraction:g} % in "
                       f"{WITHIN_S:g} s.", estimate=np.array([lost(SHORTEST_S), lost(LONGEST_S)]))


def main(scene_file: str, card_file: str, out: str) -> None:
    """Write the scene with the loading time after which a kept depth loses the paper's share of its mean pressure."""
    scene, card = read_scene(scene_file), read_card(Path(card_file))
    fraction = paper_value("9", LOST.format("depth")) / 100
    series = material_of(scene, card).series
    first = time_that_loses(fraction, lambda t: lost_by_series(series, t), (SHORTEST_S, LONGEST_S))
    found = time_that_loses(fraction, lambda t: lost_by_touch(scene, card, t), (first / 2, 2 * first))
    lines = [line for line in Path(scene_file).read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    text = "\n".join([f"# {Path(scene_file).name}, loaded in the time that loses {100 * fraction:g} % of the mean "
                      f"pressure in {WITHIN_S:g} s", *lines, f"loading_s = {found!r}", ""])
    Path(out).write_text(text, encoding="utf-8")  # [hold] is the scene's last table
    if read_scene(out).hold != replace(scene.hold, loading_s=found):
        raise ValueError(f"{scene_file}: [hold] must be its last table, and without loading_s.")
    print(f"loading over {found:.4g} s; {first:.4g} s by the series alone")


if __name__ == "__main__":
    main(*sys.argv[1:])
