"""Energy and response of a law at many points, in loops that are compiled once a law and kept on disk; without numba
the law's functions of arrays."""

import functools
from collections.abc import Callable

import numpy as np

from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.jit import compilable, compiled, compiles


def energies(law: Law, x: Array) -> Array:
    """(n,) energies, Pa, at logarithmic stretches x (n, 3)."""
    if not compiles():
        return law.energy(x)
    out = np.empty(len(x))
    _energies(type(law))(law.numbers, x, out)
    return out


def responses(law: Law, x: Array, mean: Array, half: Array) -> tuple[Array, Array, Array]:
    """Kirchhoff stresses (n, 3), their derivatives (n, 3, 3) and divided differences (n, pairs), Pa, at logarithmic
    stretches x (n, 3); mean, half (n, pairs) belong to the first of the pairs (1, 2), (1, 3), (2, 3)."""
    if not compiles():
        return law.kirchhoff(x), law.tangent(x), law.difference(mean, half, x[:, ::-1][:, :mean.shape[1]])
    tau, tangent, slope = np.empty(x.shape), np.empty((*x.shape, 3)), np.empty(mean.shape)
    _responses(type(law))(law.numbers, x, mean, half, tau, tangent, slope)
    return tau, tangent, slope


@functools.cache
def _energies(law: type[Law]) -> Callable[..., None]:
    compilable(law.energy_at)
    energy_at = law.energy_at

    def energies_of(p, x, out):
        for k in range(x.shape[0]):
            out[k] = energy_at(p, x[k, 0], x[k, 1], x[k, 2])

    return compiled(energies_of, law.__module__)


@functools.cache
def _responses(law: type[Law]) -> Callable[..., None]:
    if law.respond is not None:
        compilable(law.respond)
        return compiled(law.respond)
    compilable(law.stress_at, law.tangent_at, law.difference_at)
    stress_at, tangent_at, difference_at = law.stress_at, law.tangent_at, law.difference_at

    def responses_of(p, x, mean, half, tau, tangent, slope):
        for k in range(x.shape[0]):
            a, b, c = x[k, 0], x[k, 1], x[k, 2]
            tau[k, 0], tau[k, 1], tau[k, 2] = stress_at(p, a, b, c)
            own = tangent_at(p, a, b, c)
            tangent[k, 0, 0], tangent[k, 1, 1], tangent[k, 2, 2] = own[0], own[1], own[2]
            tangent[k, 0, 1], tangent[k, 0, 2], tangent[k, 1, 2] = own[3], own[4], own[5]
            tangent[k, 1, 0], tangent[k, 2, 0], tangent[k, 2, 1] = own[3], own[4], own[5]
            for pair in range(mean.shape[1]):
                slope[k, pair] = difference_at(p, mean[k, pair], half[k, pair], x[k, 2 - pair])

    return compiled(responses_of, law.__module__)
