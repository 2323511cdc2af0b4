"""Sections of the material: fits, parameters and the skin's conductivity (paper, figures 3 to 6 and table 1)."""

import itertools

import numpy as np

from benchmarks.paper import cyclic
from benchmarks.paper.section import Number, Section, against, paper_value, renamed, value_of
from benchmarks.paper.stages import Stage
from benchmarks.paper.stages_plan import CARD, CYCLES, Run
from benchmarks.paper.stated_law import SUBSCRIPTS, table_1
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import relaxation
from reports.calibration import calibration_report, calibration_tables, cycle_figures
from reports.calibration.card_record import Array, Record, read_record
from reports.document.numerals import number, percent
from reports.document.page import ReportFigure

SYNTHETIC = ("The paper publishes no raw data; the tests here are synthetic machine files made from its Table 1 plus "
             "small terms that stiffen the foam a little, so that agreement checks the program, not the foam.")
AS_BEFORE = "The test is synthetic, as that of figure 3 is."
MODES = {"3": ("uniaxial", "compressive stress at a strain of {:.2f}", (0.1, 0.4, 0.7), -1.0),
         "4": ("shear", "shear stress at a strain γ of {}", (0.5, 0.9), 1.0)}
SAYS = {"3": "The fit to compression alone is best there, the combined one overall rather accurate, and the one to "
             "shear alone is unstable in compression.",
        "4": "The combined model captures the shear test; no error is given."}
TITLES = {"3": "uniaxial compression and three fits", "4": "simple shear and three fits"}


def sections(run: Run) -> list[Section]:
    """Figures 3, 4, 5, table 1 and figure 6, of a run's cards."""
    if not run.card.is_file():
        why = "Not there: the card was not fitted."
        return [_absent(figure, why) for figure in ("3", "4", "5", "T1", "6")]
    record = read_record(run.card)
    plates = {plate.name: plate for plate in calibration_report.report(run.card, table_1()).plates}
    return [_mode("3", record, plates), _mode("4", record, plates), _relaxing(record, plates), _parameters(record),
            _skin(record, plates, run.stages[CYCLES])]


def _absent(figure: str, why: str) -> Section:
    return Section(figure, "the material", "", "", "", (CARD,), missing=why)


def longterm(record: Record) -> Hyperfoam:
    """The card's foam with long-term moduli; ValueError where it has none."""
    if record.card.hyperfoam is None:
        raise ValueError(f"{record.path}: the card has no hyperfoam law; fit compression and shear.")
    return record.card.hyperfoam


def _mode(figure: str, record: Record, plates: dict[str, ReportFigure]) -> Section:
    kind, words, strains, sign = MODES[figure]
    law = longterm(record)
    numbers = [Number(words.format(e), "kPa", abs(float(nominal_stress(law, kind, sign * e))) / 1e3) for e in strains]
    tests = SYNTHETIC if figure == "3" else AS_BEFORE
    errors = {"all tests": record.card.fit.get(f"{kind}_1", {}).get("relative_rms")}
    errors |= {f"{mode} alone": one["relative_rms"].get(kind)
               for mode, one in record.card.fit.get("cross_prediction", {}).items()}
    numbers += [Number(f"relative RMS of the fit to {name}", "%", 100 * value) for name, value in errors.items()
                if value is not None]
    first, last = words.format(strains[0]), words.format(strains[-1])
    worst = max(errors, key=lambda name: errors[name] or 0.0)
    differs = (f"The long-term law is {against(value_of(numbers, first), paper_value(figure, first))} at a strain of "
               f"{strains[0]} and {against(value_of(numbers, last), paper_value(figure, last))} at {strains[-1]}; "
               f"the fit to {worst} misses this test most, by {percent((errors[worst] or 0.0), 2)}.")
    return Section(figure, TITLES[figure], SAYS[figure],
                   "The fit follows the test's own rate through the Prony series; what is compared is the long-term "
                   f"law, with the paper's Table 1 put into its own equation and drawn (crosses). {tests}", differs,
                   (CARD,), _named(plates, kind, f"figure_{figure}"), tuple(numbers))


def _named(plates: dict[str, ReportFigure], name: str, new: str) -> tuple[ReportFigure, ...]:
    return (renamed(plates[name], new),) if name in plates else ()


def _relaxing(record: Record, plates: dict[str, ReportFigure]) -> Section:
    series = record.card.prony
    if series is None:
        return _absent("5", "Not there: the card has no Prony series.")
    numbers = tuple(Number(f"modulus left {t} s after a step", "–", float(relaxation(series, float(t))))
                    for t in (2, 180))
    left = [against(n.value, paper_value("5", n.quantity)) for n in numbers]
    return Section("5", "stress relaxation and Prony series",
                   "A series of three terms fits the normalised stress; Table 1 gives its terms, no error.",
                   "The ramp of the test is modelled, for it is longer than the shortest relaxation time: a step at "
                   f"once would hide much of the first term. {AS_BEFORE}",
                   f"What is left after 2 s is {left[0]}, after 180 s {left[1]}.", (CARD,),
                   _named(plates, "relaxation", "figure_5"), numbers)


def _parameters(record: Record) -> Section:
    law, series = longterm(record), record.card.prony
    order = _paper_order(law.alpha)
    numbers = [Number("initial shear modulus μ₀", "kPa", law.mu_0_Pa / 1e3)]
    numbers += [Number(f"μ{SUBSCRIPTS[k]}", "kPa", float(law.mu_Pa[i]) / 1e3) for k, i in enumerate(order)]
    numbers += [Number(f"α{SUBSCRIPTS[k]}", "–", float(law.alpha[i])) for k, i in enumerate(order)]
    if series is not None:
        numbers += [Number(f"g{SUBSCRIPTS[k]}", "–", float(g)) for k, g in enumerate(series.g)]
        numbers += [Number(f"τ{SUBSCRIPTS[k]}", "s", float(tau)) for k, tau in enumerate(series.tau_s)]
    spread = 100 * max(abs(n.value / paper_value("T1", n.quantity) - 1) for n in numbers if n.quantity.startswith("μ")
                       and n.quantity != "μ₀")
    mu_0 = against(law.mu_0_Pa / 1e3, paper_value("T1", "initial shear modulus μ₀"))
    return Section("T1", "material parameters",
                   "Six parameters of the hyperfoam law with β = 0 and a Prony series of three terms, without errors.",
                   "Terms are matched to the paper's by the nearest α. Moduli are long-term: the paper does not say "
                   "whether its own are instantaneous. Poisson's ratio is 0 as in the paper.",
                   f"Single terms are up to {number(spread, 2)} % off the paper's although the curves agree, for the "
                   f"tests do not distinguish them; their sum μ₀, which they determine, is {mu_0}.", (CARD,), (),
                   tuple(numbers), (calibration_tables.parameters(record.card),))


def _paper_order(alpha: Array) -> tuple[int, ...]:
    """Terms in the order of the paper's whose exponents they are nearest to, all together; as they are where they are
    not three."""
    paper = np.array([paper_value("T1", f"α{SUBSCRIPTS[k]}") for k in range(3)])
    if alpha.size != paper.size:
        return tuple(range(alpha.size))
    return min(itertools.permutations(range(paper.size)), key=lambda order: np.abs(alpha[list(order)] - paper).sum())


def _skin(record: Record, plates: dict[str, ReportFigure], cycles: Stage) -> Section:
    numbers: list[Number] = []
    drawn: list[ReportFigure] = []
    if (cycled := cycles.folder / "card.json").is_file():
        own = read_record(cycled)
        table, row = own.tables["conductivity_1_cycles"], own.card.fit["conductivity_1"]
        *files, specimen = cycles.inputs
        drawn += [cyclic.over_time("figure_6b", cyclic.record(files, specimen)),
                  renamed(cycle_figures.cycles("conductivity_1", table, row), "figure_6b-cycles")]
        numbers = [Number("largest strain of the cycles", "–", float(own.tests["conductivity_1"].strain.max())),
                   Number("resistance at rest, first cycle", "kΩ", float(table["resistance_rest_Ohm"].iloc[0]) / 1e3),
                   Number("resistance at rest, last cycle", "kΩ", float(table["resistance_rest_Ohm"].iloc[-1]) / 1e3)]
    law = record.card.conductivity
    if law is not None:
        numbers += [Number("conductivity at rest c₀", "S/m", law.c0_S_per_m),
                    *(Number(f"coefficient a{SUBSCRIPTS[k]}", "–", float(a)) for k, a in enumerate(law.a))]
    drawn += _named(plates, "conductivity", "figure_6c")
    return Section("6", "resistance over cycles and conductivity over strain",
                   "(b) The resistance falls from cycle to cycle and settles; (c) the conductivity falls with tension, "
                   "and a cubic carries it on to compression. Neither coefficients nor values are printed.",
                   "Conductivity of graphite spray, 30 S/m on 20 µm, stands for the paper's unprinted values. The "
                   "resistance is reduced with the current length and a coating of constant thickness. The cubic is "
                   "kept positive down to −0.9.",
                   "Both courses are the paper's in kind; their size cannot be compared. A touch stretches the skin in "
                   "its plane, inside (c); driven through its thickness it would stand on the extrapolated side.",
                   (CARD, CYCLES), tuple(drawn), tuple(numbers))
