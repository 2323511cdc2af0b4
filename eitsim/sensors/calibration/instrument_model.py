"""An untouched sensor and its instrument: a smooth sheet, its electrodes, currents, channels and leaks to ground.

Reading m of a drive with current I into its sources and the sink at ground is w_m . (g u), where u solves
(Y + diag(leak)) u = c I at every electrode but the sink, whose u is 0, and Y is the admittance of the complete
electrode model, of an uneven sheet as `uneven_sheet` has it. Gains g are against ground, so that the common mode of a
drive reaches its differences through unequal gains; c are the sources' true currents over the nominal ones.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eitsim.electrics.cem.boundary_integral import RimAdmittance
from eitsim.electrics.cem.uneven_sheet import MODES
from eitsim.electrics.forward.skins import skin_of
from eitsim.electrics.outline.edge_admittance import EdgeAdmittance
from eitsim.scene.calibrated_electrodes import NAMES
from eitsim.scene.channels import Channels, sinks
from eitsim.scene.drive import Protocol
from eitsim.scene.electrodes import contact_impedances, widths
from eitsim.scene.scene import Body, Electrodes
from touchcal.arrays import Array


@dataclass(frozen=True)
class Group:
    """Parameters of one kind."""

    name: str  # with the unit of its value as written
    each: str  # one for the "sensor", or for each "electrode", "source" or "mode" of the sheet
    prior_sd: float  # in the unit of the state
    unit: float = 1.0  # value as written, by that of the state
    start: float = 0.0  # prior mean, where the sensor file says nothing
    gauge: bool = False  # whether the mean of all is fixed, since no reading determines it


# In the order in which a fit frees them. Nothing is known of the conductance but what the readings' size says.
GROUPS = {
    "conductance": Group(NAMES["conductance"], "sensor", 10.0),
    "contacts": Group(NAMES["contacts"], "electrode", 2.0),
    "width": Group(NAMES["width"], "sensor", 0.1),
    "positions": Group(NAMES["positions"], "electrode", 0.5e-3, 1e3, gauge=True),
    "gains": Group(NAMES["gains"], "electrode", 0.03, start=1.0, gauge=True),
    "currents": Group(NAMES["currents"], "source", 0.03, start=1.0, gauge=True),
    "leaks": Group(NAMES["leaks"], "electrode", 30e-6, 1e6),
    "sheet": Group(NAMES["sheet"], "mode", 0.05),
    "widths": Group(NAMES["widths"], "electrode", 0.05, gauge=True),
}


_OF_BODY = ("conductance", "contacts", "width", "positions", "sheet", "widths")  # groups that its admittance depends on


@dataclass(frozen=True)
class Instrument:
    """What is held while parameters are fitted: the body, the electrodes by design, and which of them drive."""

    body: Body
    electrodes: Electrodes
    sources: tuple[int, ...]  # electrodes that some drive takes as a source, from 0
    start_conductance_S: float  # about which the prior of the conductance lies
    # on a skin with an outline: electrodes for which the mesh is made; None: roughly for those by design
    meshed_for: Electrodes | None = None

    def numbers(self, group: str) -> tuple[int, ...]:
        """The electrodes that a group's parameters belong to; (0,) for one of the whole sensor."""
        return {"sensor": (0,), "electrode": tuple(range(self.electrodes.count)), "source": self.sources,
                "mode": tuple(range(len(MODES)))}[GROUPS[group].each]

    @cached_property
    def places(self) -> Mapping[str, slice]:
        """Where each group's parameters stand in a state (p,)."""
        ends = np.cumsum([0, *(len(self.numbers(group)) for group in GROUPS)]).tolist()
        return {group: slice(*ends[k:k + 2]) for k, group in enumerate(GROUPS)}

    @property
    def size(self) -> int:
        """Number of parameters p."""
        return sum(len(self.numbers(group)) for group in GROUPS)

    @property
    def names(self) -> tuple[str, ...]:
        """(p,) names with their units, electrodes from 0."""
        return tuple(one.name + (f"_{k:02d}" if one.each != "sensor" else "") for group, one in GROUPS.items()
                     for k in self.numbers(group))

    @property
    def units(self) -> Array:
        """(p,) values as written by those of the state."""
        return self._each([one.unit for one in GROUPS.values()])

    @property
    def prior_mean(self) -> Array:
        """(p,) what the sensor file says, and what an ideal instrument is."""
        out = self._each([one.start for one in GROUPS.values()])
        out[self.places["conductance"]] = np.log(self.start_conductance_S)
        out[self.places["contacts"]] = np.log(contact_impedances(self.electrodes))
        return out

    @property
    def prior_sd(self) -> Array:
        """(p,) standard deviations before the gauges are fixed."""
        return self._each([one.prior_sd for one in GROUPS.values()])

    def gauged(self, change: Array) -> Array:
        """Changes of states (..., p) without what no reading determines: the turn of the ring on a disc, a common gain
        or current."""
        out = np.array(change)
        for group in (name for name, one in GROUPS.items() if one.gauge):
            if group == "positions" and not self.body.edge.is_round:
                continue
            own = self.places[group]
            out[..., own] -= out[..., own].mean(axis=-1, keepdims=True)
        return out

    def built(self, state: Array) -> Electrodes:
        """The electrodes of a state."""
        design, wider = self.electrodes, state[self.places["width"]] + state[self.places["widths"]]
        offset = state[self.places["positions"]]
        return replace(self.body.edge.moved(design, offset), width_m=tuple(widths(design) * np.exp(wider)),
                       contact_impedance_Ohm_m=tuple(np.exp(state[self.places["contacts"]])))

    def around(self, state: Array) -> "Instrument":
        """The same, its mesh, where it has one, made closely for the electrodes of a state."""
        return replace(self, meshed_for=self.built(state))

    def channels(self, state: Array) -> Channels:
        """The channels of a state, its sheet conductance among them."""
        factors = np.ones(self.electrodes.count)
        factors[list(self.sources)] = state[self.places["currents"]]
        return Channels(tuple(state[self.places["gains"]].tolist()), tuple(factors.tolist()),
                        tuple(state[self.places["leaks"]].tolist()),
                        (float(np.exp(state[self.places["conductance"]][0])),),
                        tuple(state[self.places["sheet"]].tolist()))

    def _each(self, values: list[float]) -> Array:
        return np.repeat(values, [len(self.numbers(group)) for group in GROUPS])


def sources(asked: Protocol) -> tuple[int, ...]:
    """Electrodes, from 0, into which some pattern drives current."""
    return tuple(np.flatnonzero((asked.currents_A > 0).any(axis=0)).tolist())


def voltages(instrument: Instrument, asked: Protocol, state: Array) -> Array:
    """Readings (patterns, readings), V, of a state (p,); ValueError where its electrodes overlap."""
    return instrument_readings(instrument, asked, state, _edge(instrument, state).admittance_S)


def instrument_readings(instrument: Instrument, asked: Protocol, state: Array, admittance_S: Array) -> Array:
    """Readings (patterns, readings), V, that a state's gains, currents and leaks make of a body's admittance (N, N)."""
    potential, _ = _grounded(instrument, asked, state, admittance_S)
    return (asked.weights @ (state[instrument.places["gains"]] * potential)[..., None])[..., 0]


def derivatives(instrument: Instrument, asked: Protocol, state: Array,
                groups: Collection[str] = tuple(GROUPS)) -> tuple[Array, Array]:
    """Readings (patterns, readings), V, of a state (p,) and their derivatives (patterns, readings, p) by parameters of
    some groups; 0 by others of the body."""
    edge, places = _edge(instrument, state), instrument.places
    potential, transfer = _grounded(instrument, asked, state, edge.admittance_S)
    gain = state[places["gains"]]
    change = np.zeros((*potential.shape, instrument.size))
    for group in (name for name in _OF_BODY if name in groups):
        by_state = _by_group(instrument, state, edge, group)
        change[..., places[group]] = -transfer @ np.einsum("pij,dj->dip", by_state, potential)
    change[..., places["leaks"]] = -transfer * potential[:, None, :]
    driven = np.array(instrument.sources)
    change[..., places["currents"]] = (transfer * np.maximum(asked.currents_A, 0.0)[:, None, :])[..., driven]
    change *= gain[:, None]
    change[..., places["gains"]] = potential[:, :, None] * np.eye(len(gain))
    return (asked.weights @ (gain * potential)[..., None])[..., 0], asked.weights @ change


def _by_group(instrument: Instrument, state: Array, edge: RimAdmittance | EdgeAdmittance, group: str) -> Array:
    """(parameters, N, N) derivatives of the admittance by those of one group of the body."""
    if group in ("conductance", "contacts"):
        layer = np.exp(state[instrument.places["conductance"]] + state[instrument.places["contacts"]])
        by_contact = layer[:, None, None] / instrument.body.edge.size_m * edge.by_layer
        return by_contact if group == "contacts" else (edge.admittance_S + by_contact.sum(axis=0))[None]
    if group == "positions":
        return edge.by_angle / instrument.body.edge.size_m
    if group == "sheet":
        return edge.by_sheet
    return edge.by_width if group == "widths" else edge.by_width.sum(axis=0)[None]


def _edge(instrument: Instrument, state: Array) -> RimAdmittance | EdgeAdmittance:
    """The admittance of a state's electrodes, by an integral along the rim of a disc, else by a mesh of the skin."""
    body, electrodes, places = instrument.body, instrument.built(state), instrument.places
    conductance, modes = float(np.exp(state[places["conductance"]][0])), state[places["sheet"]]
    solver = skin_of(body, electrodes, conductance)
    return solver.admittance(modes, instrument.start_conductance_S, instrument.electrodes, instrument.meshed_for)


def _grounded(instrument: Instrument, asked: Protocol, state: Array, admittance: Array) -> tuple[Array, Array]:
    """Potentials (patterns, N), V, and the transfer impedance (patterns, N, N) with each pattern's sink at ground."""
    whole, ground = admittance + np.diag(state[instrument.places["leaks"]]), sinks(asked)
    transfer = np.zeros((len(whole), *whole.shape))
    for sink in np.unique(ground):
        rest = np.delete(np.arange(len(whole)), sink)
        transfer[sink][np.ix_(rest, rest)] = np.linalg.inv(whole[np.ix_(rest, rest)])
    factor = np.ones(len(whole))
    factor[list(instrument.sources)] = state[instrument.places["currents"]]
    transfer = transfer[ground]
    return np.einsum("dij,dj->di", transfer, factor * np.maximum(asked.currents_A, 0.0)), transfer
