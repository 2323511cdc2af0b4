"""The command `touchcal`: the first touch within a minute, of a made-up foam, and where to go from there."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from touchcal.errors import InputFileError
from touchcal.terminal import application, check_out, run, waiting

app = application("Fit a soft material, simulate touches of its skin, read them from voltages. The commands are "
                  "matcal, eitsim and surrogate; `touchcal demo` shows a touch at once.")

# A disc of 200 mm and 10 mm thick, of foam that nobody measured, and one touch of it.
CARD, SCENE, PAGE, RESULT = "card.json", "scene.toml", "press.html", "touch.json"
_SCENE = """# One touch: a flat punch of 14 mm under 1 N, 20 mm from the centre of the disc. Every key is optional.
[punch]
x_mm = 20
diameter_mm = 14
force_N = 1
"""
# The page's learned map: that of docs/tutorials/6_live.py, 84 simulated touches of this card.
_LEARNED = Path(__file__).parents[1] / "live" / "page" / "pressed_foam.json"


@app.command()
def demo(out: Annotated[Path, typer.Option(help="Folder of what is written.")] = Path("touchcal-demo"),
         browser: Annotated[bool, typer.Option(help="Open the page where one presses the skin.")] = True) -> None:
    """Write a page where one presses a simulated skin, then solve one touch of it.

    The foam and all readings are made up. The first touch compiles the solvers, once; without the extra `fast` it
    takes ten seconds.

    Example: touchcal demo
    """
    import numpy as np

    import eitsim
    import matcal
    from surrogate.live.whole_page import page_with

    check_out(out, folder=True)
    if (out / SCENE).exists() and (out / SCENE).read_bytes() != _SCENE.encode():
        raise InputFileError(out / SCENE, "it was edited, and would be written anew. Give another folder by --out, or "
                                          f"solve it: eitsim run {out / SCENE} --card {out / CARD}.")
    out.mkdir(parents=True, exist_ok=True)
    page = out / PAGE
    page.write_text(page_with(_LEARNED.read_text(encoding="utf-8")), encoding="utf-8")
    opened = browser and _shown(page)
    print(f"page: {page}{'' if opened else ': open it in a browser'}, and press the skin")
    card = matcal.MaterialCard("made-up foam (synthetic)", matcal.Hyperfoam(*np.array([[9530.0], [8.0], [0.0]])),
                               conductivity=matcal.Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4)))
    matcal.write_card(card, out / CARD)
    (out / SCENE).write_text(_SCENE, encoding="utf-8")
    with waiting("solving a touch; the first compiles the solvers"):
        result = eitsim.simulate(eitsim.read_scene(out / SCENE), card)
    (touch,) = result.touches
    assert result.readings is not None
    print(f"""touch: 14 mm, 1 N, on a made-up foam of 10 mm
  depth                {1e3 * touch.depth_m:.2f} mm +- {result.error_estimate["depth"]:.1%}
  largest pressure     {touch.sigma_max_Pa / 1e3:.1f} kPa
  contact area         {1e6 * touch.contact_area_m2:.0f} mm2
  largest signal       {1e3 * abs(result.readings.signal_V).max():.2f} mV of {result.readings.signal_V.size} readings \
+- {result.error_estimate["signal"]:.1%}
  CPU                  {touch.cpu_s:.1f} s
next:
  eitsim run {out / SCENE} --card {out / CARD} --out {out / RESULT}
      the same touch with every error; edit the scene and run it again
  matcal fit uniaxial.csv shear.csv --out card.json
      a card of your own material""")


def _shown(page: Path) -> bool:
    """Whether a browser with windows opened the page."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    return webbrowser.open(page.resolve().as_uri())


def main() -> None:
    """Entry point."""
    run(app, "touchcal")
