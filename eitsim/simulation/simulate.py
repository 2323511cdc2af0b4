"""One scene, end to end: plan, mechanics, skin and electrics, readings."""

import logging
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.interaction import expected, interaction
from eitsim.scene.curved.curved_scene import AnyScene, CurvedScene, read_any_scene
from eitsim.scene.results import Moment, Plan, Readings, Result, SignalParts, Touch, of_strain
from eitsim.scene.scene import Scene, as_scene
from eitsim.sheet.sheet_conductance import FoldedSkin
from eitsim.simulation.choose import Chosen, choose
from eitsim.simulation.contact_end import variants, with_conductors
from eitsim.simulation.curved.curved_plan import curved_plan
from eitsim.simulation.curved.solve_curved_scene import solve_curved_scene
from eitsim.simulation.error_budget import numerical_errors, signal_change, signal_overlaps
from eitsim.simulation.layers.layer_readings import layer_readings
from eitsim.simulation.material import Material, material_of
from eitsim.simulation.outcome import solved, stopped
from eitsim.simulation.plan import make_plan, plan_of
from eitsim.simulation.reuse import scene_shape, table_for
from eitsim.simulation.validity import check_positive, positive_limits, strained_too_far
from matcal.card import MaterialCard, as_card, lacking
from matcal.laws.conductivity import Conductivity, NotPositive
from touchcal.errors import NotConverged
from touchcal.parallel.one_thread import ONE_THREAD
from touchcal.run_cost import cost_from_here

# Part of the requested signal error, or of what the touches themselves miss where more, that electrics may use up.
ELECTRICS_SHARE = 0.2
# Part of a numerical error that half the element size leaves: 0.3 to 0.6 of what is stated.
FINER_LEAVES = 0.6
# Part of the requested signal error up to which the worst touch's may stand for all; relative error of the signals of
# touches alone, which only weight the errors of each.
_PLAIN_SHARE, _ROUGH = 0.8, 0.05
# Relative change of the signal by what the skin is where its law is not positive, from which on a touch is refused.
_PAST_LAW = 0.1


def simulate(scene: AnyScene | Path | str, card: MaterialCard | Path | str, *, exact: bool = False,
             reuse: bool = False) -> Result:
    """Solve one scene with one material: depth, pressure, contact and electrode voltages, each with its error estimate.

    Parameters
    ----------
    scene
        A `Scene` (lengths in m, forces in N), one on a curved body, or a scene file (TOML).
    card
        A `MaterialCard`, or the file of one.
    exact
        Turn off what the plan leaves out where that is built; the plan says what stays.
    reuse
        Take touches from a stored load path of their punch; the first one solves and keeps it. Not with `exact`.

    Returns
    -------
    Result
        Its `outcome` is "ok", or it names a refusal or a failure of a solver, which `message` explains; `touches` hold
        the mechanics of each punch (m, N, Pa), `readings` the voltages (V; patterns x readings), `error_estimate`
        relative errors. Of a hold they are those of its last time; `moments` holds every time. `result_document` makes
        of it what `eitsim run --out` writes.

    Raises
    ------
    ValueError
        Where the scene or the card lacks or contradicts something, or load paths do not serve the scene.
    InputFileError
        Where a file cannot be read.

    Examples
    --------
    >>> import eitsim
    >>> import matcal
    >>> foam = matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm")
    >>> card = matcal.MaterialCard("foam", foam, conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
    >>> scene = eitsim.Scene(punches=[eitsim.Punch(diameter_m=0.014, force_N=0.2)], accuracy=eitsim.Accuracy(0.05))
    >>> touch = eitsim.simulate(scene, card)
    >>> touch.outcome, touch.readings.signal_V.shape
    ('ok', (16, 13))
    """
    if exact and reuse:
        raise ValueError("exact solves every touch separately; leave out reuse.")
    scene, card, table = _read(scene), as_card(card), None
    if isinstance(scene, CurvedScene):
        if reuse:
            raise ValueError("reuse: load paths are those of flat layers; leave it out on a curved body.")
        return solve_curved_scene(scene, card, exact=exact)
    if reuse:
        if scene.skin.fills:
            raise ValueError("reuse: load paths hold the surface of touches, and a layer that conducts in its volume "
                             "needs the inside; leave it out.")
        table, note = table_for(scene_shape(scene, card))
        if note:
            logging.getLogger(__name__).warning("load path: %s", note)
    return solve_scene(scene, card, exact=exact, table=table)


def plan(scene: AnyScene | Path | str, card: MaterialCard | Path | str, *, exact: bool = False) -> Plan:
    """What solving a scene needs and leaves out, the reason, and the error each omission may cost; nothing is solved.

    Parameters
    ----------
    scene, card, exact
        As in `simulate`.

    Returns
    -------
    Plan
        `decisions`, their joint `error_bound` (relative, of the signal), and `refusal`: why the scene cannot be solved,
        empty where it can.

    Raises
    ------
    ValueError, InputFileError
        As in `simulate`.

    Examples
    --------
    >>> import eitsim
    >>> import matcal
    >>> foam = matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm")
    >>> card = matcal.MaterialCard("foam", foam, conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
    >>> eitsim.plan(eitsim.Scene(punches=[eitsim.Punch(depth_m=0.002)]), card).refusal
    ''
    """
    card, scene = as_card(card), _read(scene)
    made = curved_plan(scene, material_of(scene.flat, card)) if isinstance(scene, CurvedScene) else make_plan(
        scene, card, exact=exact)
    return replace(made, refusal=made.refusal or lacking(card, "conductivity", "the skin"))


def _read(scene: AnyScene | Path | str) -> AnyScene:
    known = scene if isinstance(scene, Scene | CurvedScene) else read_any_scene(scene)
    return known if isinstance(known, CurvedScene) else as_scene(known)


@ONE_THREAD
def solve_scene(scene: Scene, card: MaterialCard | Material, *, exact: bool = False, bodies: bool = True,
                table: Table | None = None) -> Result:
    """Solve a scene with a card or its material; a refusal or a failure of a solver is the result's outcome, which its
    message explains.

    exact: on the finer mesh of the foam, and on a mesh of the skin, from the start, as the plan says; bodies: solve
    electrodes as bodies where leaving that out costs more than allowed; table: load paths that serve the touches they
    hold to the requested error (choose.served), not with exact.
    ValueError where the card lacks a part that the scene needs.
    """
    cost = cost_from_here()
    material = material_of(scene, card)
    _ = material.skin  # ValueError where the card lacks it
    chosen = choose(scene, material, exact=exact, bodies=bodies, table=table)
    made = plan_of(chosen)
    result = _solved(chosen, made) if chosen.why is None else Result("refused", made, message=made.refusal)
    return replace(result, cost=cost())


class _Refused(ValueError):
    """What only the solved touch shows."""


def _solved(chosen: Chosen, plan: Plan) -> Result:
    """A planned scene, solved; without a cost yet."""
    try:
        try:
            found = _once(chosen, plan)
        except _Refused:  # a coarse mesh in three dimensions may strain the skin far more where a contact ends
            if not (finer := chosen.finer_layers()):
                raise
            return _once(finer, plan)
        if chosen.bodies and _finer_helps(found, chosen.scene) and (finer := chosen.finer(found.touches)):
            with suppress(NotConverged):
                return _once(finer, plan)
        return found
    except _Refused as error:
        return Result("refused", plan, message=str(error))
    except NotConverged as error:
        return stopped(plan, error)


def _once(chosen: Chosen, plan: Plan) -> Result:
    """A scene, solved as chosen."""
    if chosen.scene.hold.time_s:
        moments = _moments(chosen)
        return _result(chosen, plan, moments[-1].touches, moments[-1].readings, moments)
    touches = chosen.touches()
    readings = readings_of(chosen.scene, touches, chosen.material.skin, chosen.exact, chosen.groups)
    return _result(chosen, plan, touches, readings, ())


def _finer_helps(found: Result, scene: Scene) -> bool:
    """Whether the requested error is missed, as where the parts of skin and conductor nearly cancel, and finer meshes
    of the foam are expected to meet it."""
    error, numerical = (known.get("signal", 0.0) for known in (found.error_estimate, found.numerical_error))
    return found.outcome == "ok" and error > scene.accuracy.signal >= error - (1 - FINER_LEAVES) * numerical


def _result(chosen: Chosen, plan: Plan, touches: tuple[Touch, ...], readings: Readings,
            moments: tuple[Moment, ...]) -> Result:
    """What was solved, with what neighbours change."""
    neighbours, unplanned = _neighbours(chosen, touches)
    return replace(solved(chosen.scene, plan, touches, readings, moments, unplanned), interaction=neighbours)


def _neighbours(chosen: Chosen, touches: tuple[Touch, ...]) -> tuple[dict[str, float], dict[str, float]]:
    """What neighbours may change of the solved touches, and what of that the plan did not count."""
    if len(touches) < 2:
        return {}, {}
    punches = chosen.scene.punches
    found = interaction(tuple(zip(punches, touches, strict=True)), chosen.groups)
    planned = expected(chosen.scene.body, punches, chosen.groups)
    return found, {key: max(value - planned, 0.0) for key, value in found.items()}


def readings_of(scene: Scene, touches: tuple[Touch, ...], skin_law: Conductivity, exact: bool,
                groups: Sequence[tuple[int, ...]] = ()) -> Readings:
    """Readings of solved touches, as fine as the scene asks for or as the touches are themselves, with the parts of the
    signal where the error of the worst touch misses the request; ValueError where the conductivity is not positive.
    groups: touches that were solved together."""
    worst = max(scene.accuracy.signal, *(of_strain(touch.signal_errors, scene.skin.strain) for touch in touches))
    try:
        if scene.skin.fills:
            return layer_readings(scene, touches, skin_law, ELECTRICS_SHARE * worst, exact=exact)
        check_positive(skin_law, scene.skin.strain, touches)
        sheet = partial(_sheet_readings, scene, touches, exact, groups, ELECTRICS_SHARE * worst)
        try:
            return sheet(skin_law)
        except NotPositive:  # at places that no mean about a punch shows
            limits = positive_limits(skin_law)
            least, fitted = (sheet(replace(skin_law, limits=limits, held=held))
                             for held in (limits, skin_law.strain_range))
            if (past := signal_change(fitted, least)) > _PAST_LAW:
                raise
            return replace(least, past_law=past)
    except FoldedSkin as error:
        raise _Refused(str(error)) from None
    except NotPositive as error:
        raise _Refused(strained_too_far(error)) from None


def _sheet_readings(scene: Scene, touches: tuple[Touch, ...], exact: bool, groups: Sequence[tuple[int, ...]],
                    signal: float, law: Conductivity) -> Readings:
    """Those of a skin that is a sheet, whose electrics are solved to a relative error of the signal."""
    solver = partial(solve, scene.body, scene.skin, scene.electrodes, scene.drive, law=law,
                     channels=scene.channels, signal=signal, method="mesh" if exact else "auto")
    pressed = tuple(zip(scene.punches, touches, strict=True))
    found = with_conductors(solver(pressed), pressed, [solver(one) for one in variants(pressed)])
    missed = numerical_errors(touches, found, scene.skin.strain)["signal"] > _PLAIN_SHARE * scene.accuracy.signal
    alone = [(i,) for i in range(len(touches)) if not any(i in group for group in groups)]
    if not missed or len(every := (*groups, *alone)) < 2:
        return found
    each = [solver(tuple((replace(punch, conductor=False), touch) for punch, touch in (pressed[i] for i in group)),
                   signal=_ROUGH, method="auto").signal_V for group in every]
    return replace(found, parts=SignalParts(every, signal_overlaps(found.signal_V, each)))


def _moments(chosen: Chosen) -> tuple[Moment, ...]:
    """A held touch with its readings; one solve serves all times where the strains stay as they were loaded."""
    held, scene = chosen.held(), chosen.scene
    how = chosen.material.skin, chosen.exact, chosen.groups
    if scene.hold.keeps_deformation or (chosen.elastic and scene.hold.control == "depth"):
        readings = [readings_of(scene, held[0][1], *how)] * len(held)
    else:
        readings = [readings_of(scene, touches, *how) for _, touches in held]
    return tuple(Moment(t, touches, reading) for (t, touches), reading in zip(held, readings, strict=True))
