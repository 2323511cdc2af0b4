"""What a calibration leaves behind: the card, and next to it a folder with the reduced tests and their fitted curves.

The folder (card.json -> card.d) holds KIND_i.parquet for every test, with strain, the measured value, time_s where the
test has a clock, fit_* for the fitted law along the test's own history and, for stress, longterm_* for the law without
rate effects; KIND_i_cycles.parquet, one row a cycle, for a cyclic test; KIND_i_path.parquet, its loading and unloading;
predicted_i.parquet, a test kept out of the fit; bands.parquet, stress in every mode with its 95 % band, and
conductivity_band.parquet; decisions.json, test or stage -> sentences; and posterior.nc where a posterior was sampled.
"""

from __future__ import annotations

import hashlib
import platform
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from matcal.card import MaterialCard, write_card
from matcal.fitting.calibrate import FittedLaws, is_curve, labels
from matcal.fitting.hyperfoam.cross_prediction import Predicted
from matcal.fitting.hyperfoam.curves import of_mean_foam
from matcal.fitting.hyperfoam.hyperfoam_fit import modelled
from matcal.fitting.relaxation.spectrum_fit import SpectrumFit
from matcal.fitting.uncertainty.intervals import plateau_reached
from matcal.laws.conductivity import conductivity
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.law import Law
from matcal.laws.stability import stability
from matcal.posterior.derived_quantities import derived_of
from matcal.posterior.draws import FILE, write_draws
from matcal.record.bands import Columns, conductivity_band, stress_bands
from matcal.record.fit_summary import curve_of, summary
from matcal.reduction.experiment import Experiment
from touchcal.json_file import write_json
from touchcal.lazy import installed
from touchcal.whole_file import keep_mode

if TYPE_CHECKING:
    from pyarrow import Array

    from matcal.posterior.sample import Posterior

# endings of the files in the folder next to a card
WRITTEN = (".parquet", ".json", ".nc")
_PACKAGES = ("touchcal", "numpy", "scipy", "lmfit", "emcee", "arviz")


def make_card(found: FittedLaws, files: Sequence[Path], seed: int, posterior: Posterior | None = None) -> MaterialCard:
    """The card of a calibration from `files`, without the name and the folder that `write_record` gives it."""
    law = found.fit.law if found.fit else None
    groups = said(found)
    tests = set(labels(found.experiments))
    decisions = [f"{name}: {s}" if name in tests else s for name, sentences in groups.items() for s in sentences]
    tested = [*found.experiments, *(p.curve.experiment for p in found.predicted)]
    spent = dict(found.cpu_s) | ({"posterior": posterior.checks["cpu_s"]} if posterior else {})
    provenance = {"files": [{"name": p.name, "sha256": hashlib.sha256(p.read_bytes()).hexdigest()} for p in files],
                  "versions": {"python": platform.python_version()} | _versions(),
                  "synthetic": any("synthetic" in e.facts for e in tested), "seed": seed,
                  "date": datetime.now(UTC).isoformat(timespec="seconds"),
                  "decisions": decisions, "decisions_of": {name: len(group) for name, group in groups.items()},
                  "cautions": list(dict.fromkeys(c for e in found.experiments for c in e.cautions)), "cpu_s": spent}
    spectrum = found.spectrum
    return MaterialCard("foam", law, found.series.prony if found.series else None,
                        found.conductivity.law if found.conductivity else None,
                        fit=summary(found, posterior.draws if posterior else None),
                        stability=stability(law) if law else {}, provenance=provenance,
                        posterior=_posterior_part(posterior, law) if posterior else {},
                        shift=spectrum.shift.law if spectrum is not None and spectrum.shift else None,
                        softening=found.softening.damage if found.softening else None)


def _versions() -> dict[str, str]:
    found: dict[str, str] = {}
    for package in _PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def said(found: FittedLaws) -> dict[str, tuple[str, ...]]:
    """Test, then stage -> its decisions, in the order in which they were taken."""
    own = {label: e.decisions for label, e in zip(labels(found.experiments), found.experiments, strict=True)}
    return {name: group for name, group in (own | dict(found.stages)).items() if group}


def check_place(out: Path, inputs: Iterable[Path] = ()) -> None:
    """ValueError where the card `out` or the folder next to it would replace one of the `inputs`, or anything that no
    earlier fit wrote, or cannot be written."""
    if out.is_dir():
        raise ValueError(f"{out} is a folder, and a card is a file. Choose another name.")
    folder = folder_of(out)
    if folder.is_dir() and (strange := sorted(p.name for p in folder.iterdir() if p.suffix not in WRITTEN)):
        raise ValueError(f"`out` {out}: its data would replace {folder}, which holds {strange[0]}, no part of an "
                         "earlier fit. Choose another name.")
    for path in inputs:
        if path.resolve() == out.resolve() or folder.resolve() in path.resolve().parents:
            raise ValueError(f"`out` {out} would replace {path}, which is read. Choose another name.")


def write_record(card: MaterialCard, found: FittedLaws, out: Path, posterior: Posterior | None = None) -> MaterialCard:
    """The card, named after its file `out` and written there with its folder next to it; what stood there before stays
    whole until both are ready. ValueError as that of `check_place`."""
    if not out.parent.is_dir():
        raise ValueError(f"{out}: the folder {out.parent} does not exist. Create it first.")
    check_place(out)
    folder = folder_of(out)
    held = {"file": f"{folder.name}/{FILE}", **card.posterior} if card.posterior else {}
    card = replace(card, name=out.stem, data=folder.name, posterior=held, file=out)
    fresh = Path(tempfile.mkdtemp(dir=out.parent, prefix=folder.name, suffix=".part"))
    try:
        write_card(card, fresh / out.name)
        (fresh / "data").mkdir()
        _write_folder(found, posterior, fresh / "data")
        if folder.exists():
            shutil.rmtree(folder)
        (fresh / "data").rename(folder)
        keep_mode(out, fresh / out.name)
        (fresh / out.name).replace(out)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return card


def _write_folder(found: FittedLaws, posterior: Posterior | None, folder: Path) -> None:
    tests = list(zip(labels(found.experiments), found.experiments, strict=True))
    for label, experiment in tests:
        write_table(_table(found, label, experiment), folder / f"{label}.parquet")
        if experiment.cycles is not None:
            write_table(experiment.cycles, folder / f"{label}_cycles.parquet")
    paths = [(label, experiment.path) for label, experiment in tests if experiment.path is not None]
    for (label, path), fitted in zip(paths, found.softening.fitted if found.softening else (), strict=False):
        columns = {"strain": path.strain, "stress_Pa": path.stress_Pa, "fit_stress_Pa": fitted}
        clock = {} if path.time_s is None else {"time_s": path.time_s}
        write_table(columns | clock, folder / f"{label}_path.parquet")
    for k, predicted in enumerate(found.predicted, 1):
        write_table(_predicted_table(found, predicted), folder / f"predicted_{k}.parquet")
    write_json({name: list(group) for name, group in said(found).items()}, folder / "decisions.json")
    draws = posterior.draws if posterior is not None else None
    if found.fit and found.uncertainty:
        bands = stress_bands(found.fit.law, draws or found.uncertainty, found.uncertainty)
        write_table(bands, folder / "bands.parquet")
    if found.conductivity:
        write_table(conductivity_band(found.conductivity, draws), folder / "conductivity_band.parquet")
    if posterior is not None and draws is not None:
        write_draws(draws, folder / FILE, derived_of(draws), posterior.log_density, about_draws(posterior))


def write_table(columns: Columns, path: Path) -> None:
    """Write columns (n,) of numbers, truths or words as a Parquet file; nothing where pyarrow is not installed."""
    if not installed("pyarrow"):
        return
    from pyarrow import Table, parquet

    parquet.write_table(Table.from_arrays([_arrow(values) for values in columns.values()], [*columns]), path,
                        write_page_checksum=True)


def _arrow(values: NDArray[Any]) -> Array:
    """A column as pyarrow holds it, from its bytes: pyarrow's own conversion would first import pandas."""
    import pyarrow

    if values.dtype.kind == "U":
        words = [word.encode() for word in values]
        ends = np.cumsum([0, *map(len, words)], dtype=np.int32)
        return pyarrow.StringArray.from_buffers(len(words), pyarrow.py_buffer(ends), pyarrow.py_buffer(b"".join(words)))
    plain = np.array(values, dtype=np.int8 if values.dtype == bool else values.dtype, order="C")
    column = pyarrow.Array.from_buffers(pyarrow.from_numpy_dtype(plain.dtype), plain.size,
                                        [None, pyarrow.py_buffer(plain)])
    return column.cast(pyarrow.bool_()) if values.dtype == bool else column


def _predicted_table(found: FittedLaws, predicted: Predicted) -> Columns:
    """A test kept out of the fit, with what the law and the laws of single modes say of it."""
    assert found.fit is not None
    curve = predicted.curve
    columns = {"strain": curve.experiment.strain, "stress_Pa": curve.experiment.value,
               "predicted_stress_Pa": modelled(found.fit.law, curve)}
    columns |= {f"{mode}_alone_stress_Pa": modelled(alone.law, curve) for mode, alone in found.fit.alone.items()}
    return columns


def folder_of(card: Path) -> Path:
    """card.json -> card.d; ValueError for a card that would be called like its folder."""
    if card.suffix == ".d":
        raise ValueError(f"{card}: the ending .d is that of the folder next to a card. Call the card {card.stem}.json.")
    return card.with_suffix(".d")


def _table(found: FittedLaws, label: str, experiment: Experiment) -> Columns:
    if experiment.kind == "conductivity" and found.conductivity:
        law = found.conductivity.law
        columns = {"strain": experiment.strain, "conductivity_S_per_m": experiment.value,
                   "fit_conductivity_S_per_m": conductivity(law, experiment.strain)}
    elif is_curve(experiment) and found.fit:
        curve = curve_of(found, label)
        columns = {"strain": curve.experiment.strain, "stress_Pa": curve.experiment.value,
                   "fit_stress_Pa": modelled(found.fit.law, of_mean_foam(curve)),
                   "longterm_stress_Pa": nominal_stress(found.fit.law, experiment.kind, curve.experiment.strain)}
    elif (spectrum := found.spectrum) is not None and experiment.kind in ("dma", "creep"):
        columns = dict(_spectral_table(spectrum, experiment))
    else:
        columns = {"strain": experiment.strain, "stress_Pa": experiment.value}
        if found.prony:
            columns["fit_stress_Pa"] = found.prony.stress_Pa[int(label.rsplit("_", 1)[1]) - 1]
    if experiment.time_s is not None:
        columns["time_s"] = experiment.time_s
    return columns


def _spectral_table(spectrum: SpectrumFit, experiment: Experiment) -> Columns:
    """Storage and loss modulus at the frequencies of the master curve, or the compliance."""
    if experiment.sweep is None or spectrum.master_Hz is None:
        return {"strain": experiment.strain, "compliance_1_per_Pa": experiment.value,
                "fit_compliance_1_per_Pa": spectrum.fitted[0]}
    sweep = experiment.sweep
    columns: Columns = {
        "strain": experiment.strain, "frequency_Hz": sweep.frequency_Hz, "master_Hz": spectrum.master_Hz,
        "storage_Pa": experiment.value, "loss_Pa": sweep.loss_Pa, "fit_storage_Pa": spectrum.fitted[0],
        "fit_loss_Pa": spectrum.fitted[1]}
    return {**columns, **({"temperature_K": sweep.temperature_K[sweep.group]} if sweep.temperature_K.size else {})}


def _posterior_part(posterior: Posterior, law: Law | None) -> dict[str, Any]:
    draws = posterior.draws
    derived = {}
    for name, column in derived_of(draws).items():
        if name == "plateau_Pa" and (law is None or not plateau_reached(law.strain_range)):
            continue
        lo, middle, hi = np.quantile(column, [0.025, 0.5, 0.975])
        derived[name] = {"value": middle, "median": middle, "sd": column.std(), "lo": lo, "hi": hi,
                         **posterior.quantities.get(name, {})}
    return {"n": len(draws), "checks": dict(posterior.checks), "prior": posterior.prior,
            "derived": derived}


def about_draws(posterior: Posterior) -> dict[str, str | int]:
    """What a file of draws says of itself: prior, seed, versions, whether the chains converged."""
    return {"prior": posterior.prior, "seed": posterior.seed, "converged": int(bool(posterior.checks["converged"])),
            **{f"version_{package}": number for package, number in _versions().items()}}
