"""Tests in, a material card out: what the command `matcal fit` does between its options and its output."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matcal.card import MaterialCard
from matcal.fitting.calibrate import FittedLaws, calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.readers.column_options import parse_selection, selections_of
from matcal.record.write import check_place, make_card, write_record
from matcal.reduction.experiment import NO_UNLOADING
from matcal.reduction.reduce import Given, read_and_reduce, tests_of
from touchcal.errors import NotConverged
from touchcal.lazy import needed

if TYPE_CHECKING:
    from matcal.posterior.sample import Posterior


@dataclass(frozen=True)
class Calibration:
    """What `fit` found."""

    # the material
    card: MaterialCard
    # every law with its curves, residuals, intervals and decisions
    laws: FittedLaws = field(repr=False)
    # draws of the posterior; None where none was sampled
    posterior: Posterior | None = field(default=None, repr=False)
    # what was read, which `save` never replaces
    files: tuple[Path, ...] = ()

    def save(self, path: Path | str) -> Calibration:
        """Write the card and, next to it, the folder of its data, as the command `matcal fit` does.

        Parameters
        ----------
        path
            JSON file of the card, say card.json; the folder is card.d. What an earlier fit wrote there is replaced.

        Returns
        -------
        Calibration
            With the card as it was written: named after its file, and with `file` set; without pyarrow the folder has
            no tables.

        Raises
        ------
        ValueError
            Where the folder holds what no fit wrote, the card would replace a test, or the path ends in .d.
        """
        check_place(Path(path), self.files)
        return replace(self, card=write_record(self.card, self.laws, Path(path), self.posterior))


def fit(tests: Given | Sequence[Given], specimen: Path | str | None = None, *, options: FitOptions | None = None,
        predicted: Given | Sequence[Given] = (), columns: Sequence[str] = (), branch: str = "last",
        posterior: bool = False, seed: int = 0, progress: Callable[[int], None] | None = None,
        **choices: Any) -> Calibration:
    """Fit everything that tests allow: hyperfoam law, Prony series, conductivity, with their uncertainty.

    Parameters
    ----------
    tests
        One test or several. Each is a path; "[KIND=]FILE[,FILE]", as on the command line; what `read_test` returns;
        or a mapping of kinds to a file, the files of one test (`{"conductivity": ["frame.txt", "potentiostat.txt"]}`),
        arrays (strain, stress_Pa[, time_s]) - J in place of strain for volumetric, conductivity in S/m in place of
        stress - or a mapping or data frame of columns such as strain, stress_Pa, time_s, displacement_m, force_N.
        Kinds: uniaxial, biaxial, planar, shear, volumetric, relaxation, conductivity. Compression is negative.
    specimen
        TOML file with the sizes of the specimens, where files hold force and displacement.
    options
        Order of the law, Poisson-like ratio, stability, residual, weights, terms of the series.
    predicted
        Stress-strain tests that are compared with the law, not fitted.
    columns
        Which columns of files mean what, as the option `--columns`: "shear=stress=2:kPa,strain=1".
    branch
        Loading of a cyclic test that is used: "last" (preconditioned) or "first"; "all" fits the first loadings, and
        what unloading softens.
    posterior
        Whether to sample the posterior.
    seed
        Of the sampler.
    progress
        Is given the number of steps that the sampler has done.
    **choices
        Fields of `FitOptions`, in place of those of `options`: order="auto", poisson=None, stable=None, ...

    Returns
    -------
    Calibration
        Its `card` serves all that takes a card; `save` writes it with its data.

    Raises
    ------
    InputFileError
        For a file that cannot be used.
    ValueError
        For tests or choices that cannot be fitted.
    NotConverged
        Where the sampler stopped short: its `estimate` is the Calibration with the draws so far.

    Examples
    --------
    >>> import matcal
    >>> card = matcal.fit(["data_raw/uniaxial.csv", "data_raw/shear.csv"], order=2).card
    >>> card.hyperfoam.alpha.size, sorted(card.hyperfoam.strain_range), card.provenance["synthetic"]
    (2, ['shear', 'uniaxial'], True)
    """
    if posterior:
        needed("arviz", "posteriors")
    options = replace(options or FitOptions(), **choices)
    own, others = tests_of(tests), tests_of(predicted)
    if not own:
        raise ValueError("no test was given. Give a file, arrays or an Experiment for each test.")
    selected = selections_of([*own, *others], [parse_selection(text) for text in columns])
    reduced = read_and_reduce(own, specimen, selected[:len(own)], branch)
    options.check_used(reduced.experiments)
    if branch == "all" and not any(e.path is not None or NO_UNLOADING in e.facts for e in reduced.experiments):
        kinds = ", ".join(dict.fromkeys(e.kind for e in reduced.experiments))
        raise ValueError(f"`unloading` fits the cycles of uniaxial, biaxial, planar or shear tests, and the tests are "
                         f"{kinds} only. Leave it out, or add such a test.")
    compared = read_and_reduce(others, specimen, selected[len(own):], branch)
    laws = calibrate(reduced.experiments, options, compared.experiments)
    files = tuple(dict.fromkeys([*reduced.files, *compared.files, *reduced.also_read, *compared.also_read]))
    if not posterior:
        return Calibration(make_card(laws, files, seed), laws, files=files)
    from matcal.posterior.sample import sample

    try:
        draws = sample(laws.fit, laws.uncertainty, laws.prony, laws.conductivity, seed,
                       progress or (lambda done: None))
    except NotConverged as error:
        found = Calibration(make_card(laws, files, seed, error.estimate), laws, error.estimate, files)
        raise NotConverged(str(error), estimate=found) from error
    return Calibration(make_card(laws, files, seed, draws), laws, draws, files)
