"""A calibrated sensor's channels: gains against ground, the sources' true currents, leaks to ground, its sheet.

With the sink s of a pattern at ground, G(Z)_ij = Z_ij - Z_sj - Z_is + Z_ss takes currents into the body to its
electrodes' voltages. Leaks L to ground make of it T = (1 + G L)^-1 G, and of a change Z -> Z' of the body
T' - T = (1 + G' L)^-1 (G' - G) (1 + L G)^-1, in which no digits cancel. Reading m is w_m . g T c I+.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.scene.drive import Protocol, as_tuples, readings
from touchcal.arrays import Array, Index


@dataclass(frozen=True)
class Channels:
    """What lies between electrodes and readings; empty: channels without error, and a body without ground."""

    gains: tuple[float, ...] = ()  # (N,) of each electrode's voltage against ground
    current_factors: tuple[float, ...] = ()  # (N,) true current of each electrode as a source over the nominal one
    leaks_S: tuple[float, ...] = ()  # (N,) conductance from each electrode to ground, S
    conductance_S: tuple[float, ...] = ()  # (1,) sheet conductance of the untouched skin, S; empty: the card's
    sheet_modes: tuple[float, ...] = ()  # how its logarithm varies (`uneven_sheet`), which scenes do not solve
    size_error: tuple[float, ...] = ()  # (1,) relative standard deviation of touched signals' size about the model's

    def __post_init__(self) -> None:
        for name in ("gains", "current_factors", "leaks_S", "conductance_S", "sheet_modes", "size_error"):
            object.__setattr__(self, name, as_tuples(getattr(self, name)))

    @property
    def there(self) -> bool:
        """Whether readings go through channels at all."""
        return bool(self.gains or self.current_factors or self.leaks_S)


def sinks(asked: Protocol) -> Index:
    """(patterns,) the electrode at ground of each pattern, which alone draws current; ValueError where several do."""
    drawing = asked.currents_A < -1e-9 * np.abs(asked.currents_A).max(axis=1, keepdims=True)
    if len(several := np.flatnonzero(drawing.sum(axis=1) != 1)):
        raise ValueError(f"pattern {several[0]} in [drive] draws its current from {drawing[several[0]].sum()} "
                         "electrodes, and the instrument model grounds one sink. Drive into one electrode each.")
    return drawing.argmax(axis=1)


def channel_readings(asked: Protocol, channels: Channels, impedance_Ohm: Array) -> Array:
    """Readings (patterns, readings), V, through channels of a body's impedance matrix (N, N), Ohm."""
    return channel_changes(asked, channels, np.zeros_like(impedance_Ohm), impedance_Ohm, impedance_Ohm)


def channel_changes(asked: Protocol, channels: Channels, before_Ohm: Array, after_Ohm: Array,
                    change_Ohm: Array) -> Array:
    """Change of the readings (..., patterns, readings), V, where a body's impedance matrix changes by `change_Ohm`
    (..., N, N) from one to the other; of derivatives by parameters, V over their units, both are the same matrix.

    Without channels the read-out of the change alone, whatever the matrices. ValueError for a pattern of several sinks.
    """
    if not channels.there:
        return readings(asked, change_Ohm)
    count, ground = asked.currents_A.shape[1], sinks(asked)
    gains, factors, leaks = (np.array(given) if given else usual for given, usual in (
        (channels.gains, np.ones(count)), (channels.current_factors, np.ones(count)),
        (channels.leaks_S, np.zeros(count))))
    potential = np.empty((*change_Ohm.shape[:-2], *asked.currents_A.shape))
    for sink in np.unique(ground):
        own = ground == sink
        driven = (factors * np.maximum(asked.currents_A[own], 0.0)).T
        into = np.linalg.solve(np.eye(count) + leaks[:, None] * _grounded(before_Ohm, sink), driven)
        raised = np.moveaxis(_grounded(change_Ohm, sink) @ into, -2, 0)
        left = np.linalg.solve(np.eye(count) + _grounded(after_Ohm, sink) * leaks, raised.reshape(count, -1))
        potential[..., own, :] = np.moveaxis(left.reshape(raised.shape), 0, -1)
    return (asked.weights @ (gains * potential)[..., None])[..., 0]


def _grounded(impedance_Ohm: Array, sink: int) -> Array:
    row, column = impedance_Ohm[..., [sink], :], impedance_Ohm[..., [sink]]
    return impedance_Ohm - row - column + row[..., [sink]]
