"""Touches near edges or another touch, with the errors of signals that the meshes of their mechanics leave."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from eitsim.electrics.forward.nominal_sensor import signal_differences, surface_differences
from eitsim.mechanics.general.solve_general import GeneralSolution
from eitsim.mechanics.rim.correction import TwoMeshes, no_correction
from eitsim.mechanics.rim.solve_near_rim import near_rim_on_two_meshes
from eitsim.mechanics.rim.two_punches import pair_on_two_meshes
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, Scene
from matcal.laws.law import Law
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s


def solve_near_rim(law: Law, body: Body, punch: Punch, *, finer: bool = False, whole: bool = False,
                   all_edges: bool = False) -> Touch:
    """As `near_rim_on_two_meshes`, with the errors of signals."""
    return with_signal_errors(near_rim_on_two_meshes(law, body, punch, finer=finer, whole=whole, all_edges=all_edges))


def solved_together(touches: Sequence[Touch], law: Law, body: Body, punches: Sequence[Punch],
                    **how: Any) -> tuple[Touch, ...]:
    """As `pair_on_two_meshes`, with the errors of signals."""
    return tuple(map(with_signal_errors, pair_on_two_meshes(touches, law, body, punches, **how)))


def with_signal_errors(found: TwoMeshes) -> Touch:
    """The touch with the errors of signals by what a nominal sensor sees of the difference of its meshes; NotConverged
    where either leaves no skin."""
    started, touch = cpu_s(), found.touch
    at = found.body, found.punch, found.alone
    signal = found.left * signal_differences(*at, found.rough, found.fine, found.edges)
    if not np.all(np.isfinite(signal)):
        raise NotConverged(" ".join(filter(None, (
            "the skin is turned inside out on one of two meshes: the signal's error is unknown.", found.problem))),
            estimate=found.fine.metric, residuals=touch.residuals[len(found.alone.residuals):])
    errors = found.alone.signal_errors + signal
    if found.part:
        errors = errors + found.part * signal_differences(*at, no_correction(found.fine), found.fine, found.edges)
    return replace(touch, signal_errors=errors + found.settled, cpu_s=touch.cpu_s + cpu_s() - started)


def read_by(scene: Scene, punches: Sequence[Punch], found: GeneralSolution) -> tuple[Touch, ...]:
    """Touches solved together in three dimensions, with the errors of signals by what the scene's sensor reads of both
    meshes where that is more: moments are blind to what a mesh leaves next to electrodes."""
    started, pressed = cpu_s(), tuple(zip(punches, found.touches, strict=True))
    read = surface_differences(scene.body, scene.electrodes, scene.drive, pressed, found.coarser.field)
    each_s = (cpu_s() - started) / len(punches)
    return tuple(replace(touch, signal_errors=np.maximum(touch.signal_errors, read + found.by_friction),
                         cpu_s=touch.cpu_s + each_s) for touch in found.touches)
