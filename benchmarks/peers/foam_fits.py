"""Foams fitted by others: each takes tests and says the stress (Pa) of another one at its strains.

lmfit: a hyperfoam of three terms from one start. FElupe (with tensortrax): its own Storakers law of three terms from
the same start, by its `optimize`, which takes uniaxial curves alone and here 15 points, since it finds the width of
each by roots; nan where there is none or it fails. Material fingerprinting: the likeliest of its incompressible laws
(its `discover` needs Python 3.12 for a print; its database is asked here). Spline: W = sum w(l_i) with nu = 0, w' a
natural cubic spline through seven stretches, which is linear least squares. Every point counts the same.
`pip install felupe tensortrax material-fingerprinting`, the last without what it depends on.
"""

import sys
from functools import cache
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import lmfit
import numpy as np
from scipy.interpolate import CubicSpline

import matcal
from matcal.reduction.experiment import Experiment

ALPHA_START, MODULUS_START_PA = (2.0, 8.0, -2.0), 1e5
KNOTS = 7
FELUPE_POINTS, FELUPE_TRIES = 15, 30  # of all curves together; most evaluations but those of derivatives
EXPERIMENTS = {"uniaxial": "uniaxial tension/compression", "shear": "simple shear"}


def by_lmfit(tests: list[Experiment], out: Experiment) -> np.ndarray:
    """Three terms by least squares from one start, nu = 0."""
    def law(p: lmfit.Parameters) -> matcal.Hyperfoam:
        return matcal.Hyperfoam([1e3 * p[f"m{k}"].value for k in range(3)], [p[f"a{k}"].value for k in range(3)],
                                [0.0] * 3)

    start = lmfit.Parameters()
    for k, alpha in enumerate(ALPHA_START):
        start.add(f"m{k}", MODULUS_START_PA / 1e3)
        start.add(f"a{k}", alpha, min=-30, max=30)

    def left(p: lmfit.Parameters) -> np.ndarray:
        try:
            return np.concatenate([np.nan_to_num(matcal.nominal_stress(law(p), one.kind, one.strain) - one.value,
                                                 nan=1e9) for one in tests])
        except ValueError:
            return np.full(sum(one.strain.size for one in tests), 1e9)

    found: Any = lmfit.minimize(left, start)
    return matcal.nominal_stress(law(found.params), out.kind, out.strain)


def by_felupe(tests: list[Experiment], out: Experiment) -> np.ndarray:
    """FElupe's compressible foam, beta = 0.01 at the start."""
    import felupe
    import felupe.constitution.tensortrax as materials

    uniaxial = [one for one in tests if one.kind == "uniaxial"]
    if not uniaxial or out.kind != "uniaxial":
        return np.full(out.strain.size, np.nan)
    law = materials.Hyperelastic(materials.models.hyperelastic.storakers, mu=[MODULUS_START_PA / 1e6] * 3,
                                 alpha=list(ALPHA_START), beta=[0.01] * 3)
    curve = np.array([np.concatenate([1 + one.strain for one in uniaxial]),
                      np.concatenate([one.value for one in uniaxial]) / 1e6])
    curve = curve[:, np.argsort(curve[0])]
    some = np.linspace(0, curve.shape[1] - 1, FELUPE_POINTS).astype(int)
    try:
        found, _ = law.optimize(ux=curve[:, some], incompressible=False, max_nfev=FELUPE_TRIES)
        view = felupe.ViewMaterial(found, ux=1 + out.strain, ps=None, bx=None)
        return 1e6 * np.asarray(view.uniaxial()[1]).ravel()
    except ValueError:  # no width was found
        return np.full(out.strain.size, np.nan)


@cache
def _database() -> Any:
    package = ModuleType("material_fingerprinting")
    spec = find_spec("material_fingerprinting")
    assert spec is not None
    package.__path__ = list(spec.submodule_search_locations or [])
    sys.modules["material_fingerprinting"] = package
    from material_fingerprinting.Database import Database

    return Database().load_pkl("HEI", verbose=False)


def by_fingerprint(tests: list[Experiment], out: Experiment) -> np.ndarray:
    """The law whose curves have the largest cosine with those measured."""
    known = _database()
    from material_fingerprinting.Experiment import Experiment as Trial
    from material_fingerprinting.Material import Material

    def control(one: Experiment) -> np.ndarray:
        return one.strain + (one.kind == "uniaxial")

    parts = []
    for name, at, prints in zip(known.experiment_name_list, known.experiment_control_list, known.fingerprints_list,
                                strict=True):
        own = [one for one in tests if EXPERIMENTS[one.kind] == name]
        if not own:
            parts.append(np.zeros(prints.shape[1]))
            continue
        x, y = np.concatenate([control(one) for one in own]), np.concatenate([one.value for one in own])
        order = np.argsort(x)
        parts.append(np.interp(at, x[order], y[order], left=0.0, right=0.0))
    _, name, parameters, _ = known.discover(np.concatenate(parts))
    trial = Trial(name=EXPERIMENTS[out.kind])
    trial.set_control(control(out))
    return np.asarray(Material(name).conduct_experiment(trial, parameters=parameters)).ravel()


def by_spline(tests: list[Experiment], out: Experiment) -> np.ndarray:
    """w' by least squares; beyond its knots it goes on straight."""
    reach = np.concatenate([_stretches(one)[0].ravel() for one in tests])
    knots = np.linspace(reach.min(), reach.max(), KNOTS)
    columns = np.vstack([_columns(one, knots) for one in tests])
    values = np.concatenate([one.value for one in tests])
    return _columns(out, knots) @ np.linalg.lstsq(columns, values, rcond=None)[0]


def _stretches(one: Experiment) -> tuple[np.ndarray, np.ndarray]:
    """Stretches (n, k) in plane and their derivatives by the strain."""
    if one.kind == "uniaxial":
        return 1 + one.strain[:, None], np.ones((one.strain.size, 1))
    root = np.sqrt(one.strain**2 + 4)
    long, short = (root + one.strain) / 2, (root - one.strain) / 2
    return np.stack([long, short], axis=1), np.stack([long, -short], axis=1) / root[:, None]


def _columns(one: Experiment, knots: np.ndarray) -> np.ndarray:
    """(n, KNOTS) stress for each knot's value of w', less that of w'(1)."""
    unit = np.eye(KNOTS)
    inside = CubicSpline(knots, unit, bc_type="natural")

    def slope(x: np.ndarray) -> np.ndarray:
        within = np.clip(x, knots[0], knots[-1])
        return inside(within) + (x - within)[..., None] * inside(within, 1)

    stretch, rate = _stretches(one)
    return np.einsum("nkj,nk->nj", slope(stretch) - slope(np.array(1.0)), rate)


PEERS = {"lmfit": by_lmfit, "felupe": by_felupe, "fingerprint": by_fingerprint, "spline": by_spline}
