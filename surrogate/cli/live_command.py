"""`surrogate live`: the page where one presses the skin, and its export as one file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surrogate.cli.given_frames import ModelFolder, NoiseV, say
from touchcal.terminal import check_out, counted, waiting

if TYPE_CHECKING:
    from surrogate.live.serve import Show
    from surrogate.model.model import Model
    from surrogate.model.sweep_model import SweepModel

INPUT_HELP = ("- reads frames that a device writes, line by line, from standard input; serial:PORT or serial:PORT@BAUD "
              "from a serial port.")
REPLAY_HELP = "Recording or table of frames to show at its rate, or at --rate without a clock."
RATE_HELP = "Frames a second of a recording without a clock; by default 50."
SIMULATE_HELP = "Card of foam and skin: presses are answered by the simulator, from tables."
DATA_HELP = "Data set whose design describes the sensor of --simulate."
BASELINE_HELP = ("CSV of untouched frames, for --replay and devices; else those that the recording marks, or the first "
                 "20 frames, with --noise-V the first one.")
EXPORT_HELP = "Write the page as one file that presses and reads in the browser, without a server; forward models."

STARTS = "preparing the page"  # what one waits for until there is an address


def live(model_folder: ModelFolder,
         frames: Annotated[str | None, typer.Argument(metavar="[-|serial:PORT]", help=INPUT_HELP)] = None,
         port: Annotated[int, typer.Option(min=0, max=65535, help="Port of 127.0.0.1; 0 takes a free one.")] = 0,
         replay: Annotated[Path | None, typer.Option(help=REPLAY_HELP)] = None,
         rate: Annotated[float | None, typer.Option(min=1e-3, max=1e6, help=RATE_HELP)] = None,
         simulate: Annotated[Path | None, typer.Option(metavar="CARD", help=SIMULATE_HELP)] = None,
         data: Annotated[Path | None, typer.Option(help=DATA_HELP)] = None,
         scene: Annotated[Path | None, typer.Option(help="Scene that describes the sensor of --simulate.")] = None,
         baseline: Annotated[Path | None, typer.Option(help=BASELINE_HELP)] = None,
         noise_v: NoiseV = None,
         export: Annotated[Path | None, typer.Option(help=EXPORT_HELP)] = None) -> None:
    """Show a skin on a page of 127.0.0.1: press it with the mouse, by touch or with the keyboard, and see it read.

    Presses are answered by the simulator (--simulate), or without it by the model's own learned map; or the page shows
    a recording (--replay) or what a device writes (- or serial:PORT). The address holds a token that other pages do
    not know.

    Example: surrogate live forward --simulate card.json
    """
    from surrogate.live.export_page import export_page
    from surrogate.live.pictured import pictured
    from surrogate.live.serve import check_installed, serve
    from surrogate.model.model import load_single
    from surrogate.model.recorded.press_model import PressModel

    _check_choice(frames, replay, simulate, data or scene)
    if export is not None:
        _check_export({frames or "-": frames, "--replay": replay, "--simulate": simulate, "--baseline": baseline,
                       "--noise-V": noise_v, "--port": port or None, "--rate": rate})
    elif baseline is not None and frames is None and replay is None:
        raise ValueError("--baseline gives the untouched frames of a recording (--replay) or a device (-); presses on "
                         "the page have their own. Leave it out.")
    elif rate is not None and replay is None:
        raise ValueError("--rate is that of a recording (--replay). Leave it out.")
    model = load_single(model_folder)
    if isinstance(model, PressModel):
        if frames is None and replay is None:
            raise ValueError(f"{model_folder} was trained on a recording: its skin cannot be simulated or exported. "
                             "Show frames of the device with -, or a recording with --replay.")
        check_installed()
        _serve_frames(model, frames, replay, baseline, noise_v, rate, port)
        return
    pictured(model)  # a skin that the page cannot draw is refused before anything else is asked for
    if export is not None:
        check_out(export, "--export")
        export_page(model, export)
        print(f"page: {export}, {export.stat().st_size / 1e6:.2f} MB")
        return
    check_installed()
    if frames or replay:
        _serve_frames(model, frames, replay, baseline, noise_v, rate, port)
        return
    with waiting(STARTS):
        show = _pressed_show(model, simulate, data, scene, noise_v)
    serve(show, port, _served)


def _served(address: str) -> None:
    print(f"{address}\nCtrl-C stops.", flush=True)


def _check_export(given: dict[str, object]) -> None:
    if idle := [name for name, value in given.items() if value is not None]:
        raise ValueError(f"--export writes a page whose presses the model's own map answers, without a server: "
                         f"{' and '.join(idle)} would have no effect. Leave {'it' if len(idle) == 1 else 'them'} out.")


def _check_choice(frames: str | None, replay: Path | None, simulate: Path | None, sensor: Path | None) -> None:
    from surrogate.data.frame_source import check_no_port, comes_live

    if frames is not None and not comes_live(frames):
        check_no_port(frames)
        raise ValueError(f"'{frames}' is no input; - reads standard input, serial:PORT a serial port. Give a file with "
                         "--replay.")
    given = [name for name, value in ((frames or "-", frames), ("--replay", replay), ("--simulate", simulate))
             if value is not None]
    if len(given) > 1:
        raise ValueError(f"{' and '.join(given)} are different sources of readings. Give one of them.")
    if sensor is not None and simulate is None:
        raise ValueError("--data and --scene describe the sensor of the simulator, which needs --simulate CARD.")


def _serve_frames(model: Model, frames: str | None, replay: Path | None, baseline: Path | None,
                  noise_v: float | None, rate: float | None, port: int) -> None:
    from surrogate.data.frame_rows import sound_lines
    from surrogate.data.frame_source import opened
    from surrogate.live.pictured import pictured
    from surrogate.live.serve import serve
    from surrogate.live.shows import recorded_show, streamed_show

    untouched_V = None if baseline is None else sound_lines(baseline, pictured(model).readings)
    if replay is not None:
        with waiting(STARTS):
            show = recorded_show(model, replay, untouched_V, noise_v, rate)
        serve(show, port, _served)
    elif frames is not None:
        with opened(frames, say) as source:
            with waiting(STARTS):
                show = streamed_show(model, source, untouched_V, noise_v)
            serve(show, port, _served)


def _pressed_show(model: SweepModel, simulate: Path | None, data: Path | None, scene: Path | None,
                  noise_v: float | None) -> Show:
    from surrogate.live.shows import pressed_show
    from surrogate.live.skins import learned_skin, simulated_skin

    if simulate is None:
        say("presses are answered by the model's own learned map. Give --simulate CARD for the simulator.")
        return pressed_show(model, learned_skin(model), noise_v)
    say("load paths are read, or solved where none are stored, which takes minutes once.")
    return pressed_show(model, simulated_skin(model, simulate, data, scene, counted("load paths")), noise_v)
