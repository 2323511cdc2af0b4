"""The files that a run may write next to its result: fields in the foam and on the skin, frames, derivatives."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from eitsim.scene.curved.curved_scene import AnyScene, CurvedScene
from eitsim.scene.results import Result
from matcal.card import MaterialCard
from touchcal.terminal import counter


@dataclass(frozen=True)
class OutputFiles:
    """Where each file goes; None: it is not written."""

    fields: Path | None = None  # stress and strain inside the foam, VTU; or a series of the press, PVD
    frames: Path | None = None  # voltages, CSV
    skin: Path | None = None  # fields on the skin, VTU
    patterns: Sequence[int] | None = None  # drive patterns of the skin's fields, from 0; None: all
    sensitivity: Path | None = None  # derivatives of the readings, CSV
    steps: int | None = None  # of a series; None: as many as it has by default

    @property
    def places(self) -> dict[str, Path | None]:
        """Option of each file -> where it goes."""
        return {"--fields": self.fields, "--frames": self.frames, "--skin": self.skin,
                "--sensitivity": self.sensitivity}


def check_output_files(scene: AnyScene, files: OutputFiles, outs: Mapping[str, Path | None] | None = None) -> None:
    """ValueError, before anything is solved, where the scene has no such file, or the folder of a series is in the way
    of another one to be written (option -> place)."""
    if (result := (outs or {}).get("--out")) is not None and result.suffix not in ("", ".json"):
        raise ValueError(f"--out {result}: the result is JSON (jsondecode reads it in MATLAB); give a name that ends "
                         "in .json.")
    if files.skin is not None and files.skin.suffix != ".vtu":
        raise ValueError(f"--skin {files.skin}: the file is a VTU file; give a name that ends in .vtu.")
    if isinstance(scene, CurvedScene):
        _check_on_curved(files)
        return
    if files.fields is not None and files.fields.suffix not in (".vtu", ".pvd"):
        raise ValueError(f"--fields {files.fields}: the file is a VTU file; give a name that ends in .vtu, or in .pvd "
                         "for a series of the press.")
    if files.fields is not None and not all(punch.axisymmetric for punch in scene.punches):
        raise ValueError("--fields is built for upright punches with a profile; leave it out with tilt_deg or shape.")
    if files.fields is not None and files.fields.suffix == ".pvd":
        from eitsim.simulation.press_series import check_press

        check_press(scene, 1 if files.steps is None else files.steps)
        _check_series(files.fields, outs or {})
    elif files.steps is not None:
        raise ValueError("--fields-steps has no effect without a series; add --fields press.pvd.")
    if files.fields is not None and scene.hold.time_s:
        raise ValueError("--fields is not built for a hold; leave out time_s in [hold].")
    if files.fields is not None and len(scene.punches) > 1:
        raise ValueError("--fields is built for one touch; leave it out or give one [punch].")
    if files.skin is None and files.patterns is not None:
        raise ValueError("--skin-patterns has no effect without --skin; add --skin skin.vtu.")
    if files.skin is not None:
        from eitsim.electrics.forward.sheet_fields import driven_currents

        if scene.skin.fills:
            raise ValueError("--skin writes the fields of a coating, and this layer conducts in its volume; leave it "
                             "out (--fields writes what is inside the layer).")
        driven_currents(scene, files.patterns)
    if files.sensitivity is not None:
        from eitsim.simulation.derivatives.readings import check_differentiable

        check_differentiable(scene)


def _check_on_curved(files: OutputFiles) -> None:
    for flag, given in (("--fields", files.fields), ("--sensitivity", files.sensitivity)):
        if given is not None:
            raise ValueError(f"{flag} is not built on curved bodies; --skin writes what the touch does to the skin.")
    if files.skin is None and files.patterns is not None:
        raise ValueError("--skin-patterns has no effect without --skin; add --skin skin.vtu.")


def _check_series(series: Path, outs: Mapping[str, Path | None]) -> None:
    from eitsim.simulation.press_series import check_folder

    try:
        folder = check_folder(series).resolve()
    except ValueError as error:
        raise ValueError(f"--fields {error}") from None
    for flag, place in outs.items():
        if place is not None and folder in (place.resolve(), *place.resolve().parents):
            raise ValueError(f"--fields {series}: the VTU files go to the folder {series.with_suffix('')}, where "
                             f"{flag} {place} is written. Choose another name.")


def write_output_files(scene: AnyScene, result: Result, card: MaterialCard,
                       files: OutputFiles, *, exact: bool = False) -> Iterator[tuple[str, Path]]:
    """Write the files that are asked for of a result, solved exactly or not; what each is, and where."""
    if files.frames is not None and result.readings is not None:
        from eitsim.scene.frames import write_frames

        write_frames(files.frames, [moment.readings for moment in result.moments] or [result.readings])
        yield "frames", files.frames
    if isinstance(scene, CurvedScene):
        if files.skin is not None:
            from eitsim.simulation.curved.solve_curved_scene import write_skin
            from eitsim.simulation.material import material_of

            write_skin(scene, result, material_of(scene.flat, card).skin, files.skin, files.patterns)
            yield "skin", files.skin
        return
    if files.fields is not None and files.fields.suffix == ".pvd":
        from eitsim.simulation.press_series import STEPS, press_of, write_press

        (touch,), steps = result.touches, files.steps or STEPS
        with counter(steps, "steps of the press") as advance:
            touches = press_of(scene, card, touch, steps=steps, exact=exact, progress=advance)
        write_press(scene, touches, files.fields)
        yield "fields", files.fields
    elif files.fields is not None:
        from eitsim.simulation.foam_fields import write_vtu

        (touch,) = result.touches
        write_vtu(touch, files.fields)
        yield "fields", files.fields
    if files.skin is not None:
        from eitsim.electrics.forward.sheet_fields import write_skin_vtu
        from eitsim.simulation.material import material_of

        write_skin_vtu(scene, result.touches, material_of(scene, card).skin, files.skin, files.patterns)
        yield "skin", files.skin
    if files.sensitivity is not None and result.outcome == "ok":
        from eitsim.simulation.derivatives.readings import scene_sensitivity, write_sensitivity

        write_sensitivity(scene_sensitivity(scene, card), files.sensitivity)
        yield "sensitivity", files.sensitivity
