"""What one must know before a card is used: the terminal and the report say it first, in the same words."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from matcal.card import MaterialCard
from matcal.fitting.conductivity_laws import others, values_of
from matcal.fitting.uncertainty.intervals import PLATEAU_STRAIN, plateau_reached
from matcal.laws.conduction_laws import conduction_law
from matcal.laws.deformation_modes import MODES, nominal_stress
from matcal.laws.histories.damage import MOST_LOOP
from matcal.laws.histories.time_temperature import Wlf
from matcal.laws.known_laws import law_of
from matcal.laws.law import Law
from matcal.laws.prony import Prony, convolve
from matcal.reduction.experiment import CROSSED_S
from touchcal.number_words import percent

NAMES = {"drucker": "Drucker stability", "elliptic": "Ellipticity"}
# relative RMS of a fit, and of a prediction, from which on it is said; share of a relaxation time likewise
_MISFIT, _MISSED, _LOOSE = 0.05, 0.10, 0.5
# share of a test in its 95 % band below which it is said; mu_0 of soft foams, Pa; ratio of stiffness between modes from
# which on units and sizes are doubted, over the first share of their strains
_INSIDE, _SOFT_PA, _RATIO, _EARLY = 0.9, (20.0, 1e6), 1.6, 0.3
# strain that earlier loadings left, and share by which a held stress differs from the law's, from which on it is said
_SET, _HELD_OFF = 0.02, 0.15
_DOUBTED_ZERO = 0.002  # error of a strain zero whose effect on a conductivity is said
_RUBBER_PA = 2e7  # largest mu_0 of a rubber
_RUBBER = 0.49  # nu above which a rubber's was given
# slope at rest of a rubber's curve over its mu_0, by mode; that of a foam with nu = 0 is E_0 in each
_SLOPES = {"uniaxial": 3, "planar": 4, "biaxial": 6}
_PULLED = 0.02  # strain in tension from which on a test is more than compression
_ON_BOUND = 1.01  # times the shortest time that is searched up to which a fitted one is on it
_RAMP_S, _RAMP_COUNTS = 1.0, 0.005  # ramp that a hold without one may have had, change of g_infinity that is said
_LOST = 0.02  # share of the work that a cycle loses from which on it is said
_RAMPS_S = (10.0, 1000.0)  # durations of a loading for which the effect of its rate is said where it has no clock
# relative RMS of a loss modulus, and its ratio to that of the storage modulus, from which on it is said; decades
_LOSS_OFF, _OFF_RATIO, _SHIFT_OFF = 0.05, 4.0, 0.2
# strain at which laws of the conductivity are compared, and their ratio from which on it is said
_TOUCHED, _LAWS_DIFFER = -0.5, 1.2
# share of its peak by which earlier cycles move a loading that is said; points of its ramp, cycles that are followed
_LEFT_OVER, _RAMP_POINTS, _MOST_CYCLES = 0.01, 41, 20
_HARDLY = 0.02  # softening to less than this share of the stress, or by less than it, that is said
_CLOSE = 0.05  # strain from the fitted ones within which lost stability is said


def cautions(card: MaterialCard) -> tuple[str, ...]:
    """One sentence each, the gravest first; empty where there is nothing to warn of. First what may make every number
    wrong by a factor, then numbers that are not determined, records that are not what the fit takes them for, laws that
    do not follow them, what holds within the tests but not outside, and last what was not tested."""
    parts = (_origin, _units, _direction, _undecided, _volume, _assumed_nu, _two_nu, _convergence, _undetermined,
             _agreement, _open_nu, _long_term, _records, _held, _misfit, _band, _predictions, _set, _rate, _step,
             _dynamic, _together, _softened, _stability, _edge, _fastest, _at_bound, _loss, _cycled_before, _skin,
             _coverage, _series)
    return tuple(sentence for part in parts for sentence in part(card))


def unstable_inside(card: MaterialCard) -> list[tuple[str, str, float, float]]:
    """(criterion, mode, lo, hi) of every unstable range within the strains fitted in its mode."""
    fitted = card.law.strain_range if card.law else {}
    return [(criterion, mode, max(lo, fitted[mode][0]), min(hi, fitted[mode][1]))
            for criterion, modes in card.stability.items() for mode, row in modes.items()
            for lo, hi in row["unstable_strain"] if mode in fitted and overlaps((lo, hi), fitted[mode])]


def overlaps(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two ranges share more than an end."""
    return max(one[0], other[0]) < min(one[1], other[1])


def tests(card: MaterialCard) -> dict[str, Mapping[str, Any]]:
    """label -> errors of every test that was fitted."""
    return {label: row for label, row in card.fit.items() if isinstance(row, Mapping) and "relative_rms" in row
            and "kind" in row}


def relative_rms(card: MaterialCard, kind: str) -> float:
    """Relative RMS of the card's law over all fitted tests of a kind, each with the factor of its specimen."""
    return float(np.sqrt(np.mean([own_rms(row) ** 2 for row in tests(card).values() if row["kind"] == kind])))


def own_rms(row: Mapping[str, Any]) -> float:
    """Relative RMS of a fitted test after the stiffness factor of its specimen, where it has one."""
    return float(row.get("relative_rms_of_specimen", row["relative_rms"]))


def _origin(card: MaterialCard) -> Iterator[str]:
    if card.provenance.get("synthetic"):
        yield "The data are synthetic, by a line of their files (touchcal-synthetic: 1): nothing here was measured."


def _units(card: MaterialCard) -> Iterator[str]:
    """What looks like a wrong unit or size: stiffness that no soft foam has, or that differs from mode to mode."""
    if card.law is None:
        return
    most = _RUBBER_PA if card.law.body == "rubber" else _SOFT_PA[1]
    if not _SOFT_PA[0] < (mu_0 := card.law.mu_0_Pa) < most:
        yield (f"mu_0 = {mu_0:.3g} Pa is that of no soft {card.law.body} ({_SOFT_PA[0]:g} to {most:g} Pa): check the "
               "units of stress or force (kPa or MPa) and the sizes of the specimens.")
    laws = {mode: law_of(card.law.name, [np.ravel(row[p.name]).tolist() for p in card.law.parameters])
            for mode, row in card.fit.get("cross_prediction", {}).items() if mode in card.law.strain_range}
    first, *others = laws or [""]
    for mode in others:
        ratio = _stiffness(mode, card.law.strain_range[mode], laws[mode], laws[first])
        if not 1 / _RATIO < ratio < _RATIO:
            yield (f"{mode.capitalize()} is {ratio:.3g} times as stiff at small strain as {first} alone predicts: "
                   "check the units and sizes of both (the faces in shear), nu, and whether the foam is anisotropic.")


def _stiffness(mode: str, ends: tuple[float, float], own: Law, other: Law) -> float:
    """Stress of a mode by its own law over that by the law of another mode, over its first strains."""
    rest = 1.0 if mode == "volumetric" else 0.0
    far = max(ends, key=lambda end: abs(end - rest))
    strain = rest + np.linspace(0.1, 1.0, 10) * _EARLY * (far - rest)
    a, b = (nominal_stress(law, mode, strain) for law in (own, other))
    return float(a @ b / (b @ b))


def _volume(card: MaterialCard) -> Iterator[str]:
    """A material stretched like a rubber whose nu was not measured, and what nu does to its modulus."""
    kept = card.fit.get("nu", {}).get("nearly_incompressible")
    if kept is None or card.hyperfoam is None or card.hyperfoam.nu.min() > _RUBBER:
        return
    first, last = kept["nu"]
    one, other = (f"{mu / 1e3:.4g} kPa" for mu in kept["mu_0_Pa"])
    does = f"if it keeps its volume, as a rubber, mu_0 goes from {one} at nu = {first:g} to {other} at {last:g}"
    if not np.any(card.hyperfoam.nu):
        how = "taken" if card.fit["nu"]["how"] == "assumed" else "given"
        yield (f"nu = 0 was {how}, which is a foam's, for a material stretched to more than twice its length: {does}. "
               f"Give --law auto for such a material, or --poisson {last:g}, or fit nu with lateral strain.")
    else:
        yield (f"nu was given, not measured, for a material stretched to more than twice its length: {does}; the "
               "intervals leave that out.")


def _undecided(card: MaterialCard) -> Iterator[str]:
    """That --law auto found nothing in the tests which parts rubbers from foams, or only the shape of one curve, and
    what it would change."""
    by_shape = card.law is not None and card.fit.get("material", {}).get("by_shape", False)
    if by_shape and not card.fit["material"]["rubber"]:
        yield ("The test is taken for a foam's by the shape of its tension alone. A rubber that hung slack in the "
               "grips may have that shape, and has other stresses in every other mode; no interval holds that. Add "
               "lateral strain, compression or a second mode, or give --poisson.")
    elif card.law is not None and by_shape:
        yield ("The test is taken for a rubber's by the shape of its compression alone. A foam with nu of 0.2 to 0.4 "
               f"may have that shape: with nu = 0.3 its mu_0 would be {card.law.E_0_Pa / 2.6e3:.4g} kPa instead of "
               f"{card.law.mu_0_Pa / 1e3:.4g} kPa; no interval holds that. Add lateral strain or a second mode, or "
               "give --poisson.")
    if card.law is None or card.fit.get("material", {}).get("decided", True):
        return
    ranges, mu_0, E_0 = card.law.strain_range, card.law.mu_0_Pa, card.law.E_0_Pa
    mode = next(iter(ranges)) if len(ranges) == 1 else ""
    what, own, rubber = ("E_0", E_0, 3 * mu_0) if mode == "shear" else ("mu_0", mu_0, E_0 / _SLOPES.get(mode, np.nan))
    of = f", and {what} would be {rubber / 1e3:.4g} kPa instead of {own / 1e3:.4g} kPa" if np.isfinite(rubber) else ""
    pressed = "deeper compression" if ranges.get("uniaxial", (0.0, 0.0))[0] < 0 else "a compression test"
    add = "a compression or a tension test" if mode == "shear" else f"lateral strain, {pressed}, or a second mode"
    yield (f"Whether this is a rubber or a foam is not decided: {card.fit['material']['because']}. The law is a "
           f"foam's. A rubber has other stresses in every other mode{of}; no interval holds that. Give --poisson 0.5 "
           f"for a rubber, 0 for a foam, or add {add}.")


def _assumed_nu(card: MaterialCard) -> Iterator[str]:
    """nu = 0 that nothing was said of, in tests of free faces other than compression alone, on which mu_0 rests."""
    nu, ranges = card.fit.get("nu", {}), card.hyperfoam.strain_range if card.hyperfoam else {}
    if (nu.get("how") != "assumed" or "nearly_incompressible" in nu or {"shear", "volumetric"} & set(ranges)
            or not card.fit.get("material", {}).get("decided", True)):
        return
    if len(ranges) > 1 or max((hi for _, hi in ranges.values()), default=0.0) > _PULLED:
        yield ("nu = 0 was assumed, as of a foam in compression, and mu_0 rests on it: of one uniaxial curve it is "
               "E_0/(2 (1 + nu)), 23 % lower at nu = 0.3. No interval holds that. Give --poisson a value, or fit it "
               "with lateral strain, a volumetric test or shear.")


def _band(card: MaterialCard) -> Iterator[str]:
    few = [f"{label} {percent(row['inside_band'], 2)}" for label, row in tests(card).items()
           if row.get("inside_band", 1.0) < _INSIDE]
    if few:
        yield (f"The 95 % band holds too little of what was measured ({', '.join(few)}): the law does not follow these "
               "records, and its intervals are too narrow for the material.")


def _convergence(card: MaterialCard) -> Iterator[str]:
    checks = card.posterior.get("checks", {})
    if checks and not checks.get("converged", True):
        yield (f"The posterior did not converge (R-hat {checks['rhat']:.3f}, effective sample size "
               f"{checks['ess']:.0f}): do not use its intervals.")


def _long_term(card: MaterialCard) -> Iterator[str]:
    slowest = card.fit.get("prony", {}).get("slowest_s")
    if card.prony is None or slowest is None or slowest["hi"] is not None or not np.any(card.prony.g):
        return
    yield (f"The long-term moduli are not determined by this record: nothing bounds its slowest relaxation time above "
           f"({slowest['value']:.3g} s as fitted, with a 95 % interval from {slowest['lo']:.3g} s on). Hold longer, or "
           "give fewer --prony-terms.")


def _fastest(card: MaterialCard) -> Iterator[str]:
    """A fastest time on the shortest that is searched, of times that were."""
    found = card.fit.get("prony", {})
    if card.prony is None or "shortest_s" not in found or not any(found["tau_sd_s"]) or not np.any(card.prony.g):
        return
    if (fastest := float(np.min(card.prony.tau_s))) <= _ON_BOUND * found["shortest_s"]:
        yield (f"The fastest relaxation time, {fastest:.3g} s, ended on the shortest that is searched in this record: "
               "what relaxes faster is not separated from it, and instantaneous moduli are not determined. Load "
               "faster, or record finer.")


def _agreement(card: MaterialCard) -> Iterator[str]:
    drawn = card.posterior.get("derived", {})
    separation = [name for name, row in card.fit.get("derived", {}).items()
                  if name in drawn and not overlaps((row["lo"], row["hi"]), (drawn[name]["lo"], drawn[name]["hi"]))]
    if separation:
        yield (f"Fit and posterior differ by more than their 95 % intervals in {', '.join(separation)}: the law does "
               "not describe all tests at once; trust neither before the misfit is understood.")


def _stability(card: MaterialCard) -> Iterator[str]:
    lost: dict[str, list[str]] = {}
    for criterion, mode, lo, hi in unstable_inside(card):
        lost.setdefault(criterion, []).append(f"{mode} {lo:.3g} to {hi:.3g}")
    for criterion, where in lost.items():
        remedy = f" --stable {criterion} fits a law that keeps it." if card.hyperfoam else ""
        yield f"{NAMES.get(criterion, criterion)} is lost inside the fitted strains: {', '.join(where)}.{remedy}"


def _edge(card: MaterialCard) -> Iterator[str]:
    """Ellipticity that is kept within the fitted strains and lost close to them, where elements soon are."""
    fitted = card.law.strain_range if card.law else {}
    close = [f"{mode} from {near:.3g} on (fitted to {end:.3g})"
             for mode, row in card.stability.get("elliptic", {}).items() if mode in fitted
             for lo, hi in row["unstable_strain"] for end, near in ((fitted[mode][0], hi), (fitted[mode][1], lo))
             if not overlaps((lo, hi), fitted[mode]) and abs(near - end) < _CLOSE]
    if close:
        yield (f"Ellipticity is lost close to the fitted strains: {', '.join(close)}. An element pressed further may "
               "collapse" + ("; --stable elliptic with --stable-range, of the stretches that elements reach, keeps it."
                             if card.hyperfoam else "."))


def _records(card: MaterialCard) -> Iterator[str]:
    """What the records themselves give to mind: a table that is not one loading from contact on."""
    yield from card.provenance.get("cautions", ())


def _direction(card: MaterialCard) -> Iterator[str]:
    """A direction that nothing stated, next to a law."""
    if card.law is not None:
        for label, row in tests(card).items():
            if row.get("direction_assumed"):
                yield (f"Nothing tells compression from tension in {label}: its strain is positive and was read as "
                       "tension. If it is compression, write compression in the name of its file or of a column, or "
                       "direction = \"compression\" below [relaxation] of the specimen file.")


def _set(card: MaterialCard) -> Iterator[str]:
    """Cyclic tests whose loading that counts begins away from the first contact, and what the plateau would be from
    there."""
    law = card.law
    left = {label: row for label, row in tests(card).items() if abs(row.get("residual_strain", 0.0)) > _SET}
    if not left or law is None:
        return
    mean, other = float(np.mean([row["residual_strain"] for row in left.values()])), ""
    if plateau_reached(law.strain_range) and any(row["kind"] == "uniaxial" for row in left.values()):
        here, there = -nominal_stress(law, "uniaxial", [PLATEAU_STRAIN, PLATEAU_STRAIN - mean]) / 1e3
        other = (f" Counted from the first contact, the stress at {percent(-PLATEAU_STRAIN, 2)} strain would be some "
                 f"{there:.3g} kPa instead of {here:.3g} kPa.")
    yield (f"{', '.join(left)}: the loading that counts begins at a strain of {mean:.3f} that the loadings before it "
           "left, and its strain is counted from there; how much of that would recover is not in the intervals."
           f"{other} Let the specimen recover before that loading, or take the first with --branch first.")


def _held(card: MaterialCard) -> Iterator[str]:
    """A hold of another stress than the law of the compression curves gives at its strain."""
    lowest = card.law.strain_range.get("uniaxial", (0.0, 0.0))[0] if card.law else 0.0
    off = [f"{label} holds {row['stiffness_over_law']:.2f} times" for label, row in tests(card).items()
           if abs(np.log(row.get("stiffness_over_law", 1.0))) > -np.log(1 - _HELD_OFF)
           and 1.1 * lowest < row["strain_range"][0]]
    if off:
        yield (f"{', '.join(off)} the stress that the law of the other tests gives at its strain: check its sizes, its "
               "contact and its strain, and whether its foam was preconditioned like that of the other tests.")


def _misfit(card: MaterialCard) -> Iterator[str]:
    poor = [f"{label} by {percent(own_rms(row), 2)}" for label, row in tests(card).items() if own_rms(row) > _MISFIT]
    if poor:
        yield f"The fit misses (relative RMS) {', '.join(poor)}."
    tried = {row["order"]: row for row in card.fit.get("orders", ())}
    chosen = tried.get(card.hyperfoam.mu_Pa.size) if card.hyperfoam else None
    if chosen and chosen["confluence"]:
        yield (f"Single mu and alpha are not measurable ({chosen['confluence']}); mu_0, E_0 and stresses within the "
               "tests are." + _safer(chosen["order"], tried.values()))


def _at_bound(card: MaterialCard) -> Iterator[str]:
    """An outer exponent that has no standard error though its modulus has one: the fit keeps it on its bound."""
    found = card.fit.get("parameters", {})
    if card.hyperfoam is None or not found:
        return
    ends = [k for k in dict.fromkeys((1, card.hyperfoam.alpha.size)) if f"alpha_{k}" in found]
    kept = [f"alpha_{k} = {found[f'alpha_{k}']['value']:.3g}" for k in ends
            if found[f"alpha_{k}"]["stderr"] is None and found[f"mu_{k}_Pa"]["stderr"] is not None]
    if kept:
        order, tried = card.hyperfoam.alpha.size, card.fit.get("orders", ())
        clear = any(row["order"] == order and not row["confluence"] for row in tried)  # else _misfit names an order
        yield (f"{' and '.join(kept)} ended on the bound of the exponents that are searched: outside the fitted "
               "strains the law rests on that bound." + (_safer(order, tried) if clear else ""))


def _open_nu(card: MaterialCard) -> Iterator[str]:
    """A fitted nu that the tests leave open, and what that does to the modulus."""
    nu, left = card.fit.get("nu", {}), card.fit.get("not_determined", ())
    if not any(name.startswith("nu") for name in left):
        return
    ends = nu["interval"] if isinstance(nu["interval"][0], list) else [nu["interval"]]
    low, high = nu["bounds"]
    where = ", ".join(f"{lo:.3g} to {hi:.3g}" for lo, hi in ends)
    mu_0 = card.fit.get("derived", {}).get("mu_0_Pa")
    then = f"; mu_0 lies between {mu_0['lo'] / 1e3:.3g} and {mu_0['hi'] / 1e3:.3g} kPa with it" if mu_0 else ""
    yield (f"nu is not determined by these tests: its 95 % interval is {where}, searched from {low:g} to {high:g}"
           f"{then}. Add lateral strain or a volumetric test, or give a known value with --poisson.")


def _two_nu(card: MaterialCard) -> Iterator[str]:
    """Lateral strains that contradict the nu of the stresses, or the one that was given."""
    nu = card.fit.get("nu", {})
    if not nu.get("contradicted"):
        return
    lateral, other = (f"{lo:.3g}" if f"{lo:.3g}" == f"{hi:.3g}" else f"{lo:.3g} to {hi:.3g}"
                      for lo, hi in (nu["by_lateral_strain"], nu["without"]))
    rest = (f"the stresses of the tests alone say {other}, and neither holds the other" if "value" in nu else
            f"nu = {other} was {nu['how']}, and they were not used")
    yield (f"The lateral strains say that nu is {lateral}; {rest}. Check their sign and unit, what they are measured "
           "on, and the sizes of the specimens.")


def _undetermined(card: MaterialCard) -> Iterator[str]:
    row = card.fit.get("derived", {}).get("mu_0_Pa")
    if row is not None and row["lo"] <= 0:
        yield ("The tests do not determine mu_0 with this law: its 95 % interval holds 0. Measure smaller strains, or "
               "try another --order: --verbose lists what each gives.")


def _safer(chosen: int, tried: Iterable[Mapping[str, Any]]) -> str:
    """The command that gives the best lower order whose parameters can be read."""
    clear = [row for row in tried if row["order"] < chosen and not row["confluence"]]
    if not clear:
        return ""
    best = min(clear, key=lambda row: row["bic"])
    return (f" Outside the tests --order {best['order']} is the safer law (residual {percent(best['rms'])} instead of "
            f"{percent(next(row['rms'] for row in tried if row['order'] == chosen))}).")


def _predictions(card: MaterialCard) -> Iterator[str]:
    missed = [f"{', '.join(row['source'])} ({row['kind']}) by {percent(row['relative_rms']['combined'], 2)}"
              for row in card.fit.get("predicted", ()) if row["relative_rms"]["combined"] > _MISSED]
    if missed:
        yield f"Tests kept out of the fit are missed (relative RMS): {', '.join(missed)}."


def _coverage(card: MaterialCard) -> Iterator[str]:
    fitted = [mode for mode in MODES if card.law and mode in card.law.strain_range]
    if len(fitted) == 1:
        yield (f"Only {fitted[0]} loading was fitted: every other mode is extrapolated and may be far off" + (
            "; the band of a prediction is that over the laws compared." if card.fit.get("laws") else "."))
    kinds = [row["kind"] for row in tests(card).values()]
    if kinds and len(kinds) == len(set(kinds)):
        yield "One specimen of each kind was tested: the intervals leave out the scatter from specimen to specimen."
    if card.law is not None and card.prony is None and card.law.moduli == "longterm" and kinds:
        yield "Moduli count as long-term but are not corrected for the rate of the tests: no relaxation was given."


def _rate(card: MaterialCard) -> Iterator[str]:
    """Tests that the series did not correct, and how much too stiff it says they are."""
    for label, row in tests(card).items():
        if card.prony is None or row.get("rate_corrected", True):
            continue
        if loading_s := row.get("clock_left_out_s"):
            size = percent(_excess(card.prony, loading_s), 2)
            yield (f"{label} is not corrected for rate, since its loading begins under stress that earlier cycles "
                   f"left, and counts as long-term: by the series its ramp of {loading_s:.3g} s makes mu_0 some {size} "
                   "too high. Take --branch first, or let the specimen recover before it.")
        elif loading_s := row.get(CROSSED_S):
            yield (f"{label} is not corrected for rate, since it crosses from tension to compression, and counts as "
                   f"long-term: by the series its first loading of {loading_s:.3g} s makes mu_0 some "
                   f"{percent(_excess(card.prony, loading_s), 2)} too high. Give each side a file of its own.")
        else:
            fast, slow = (percent(_excess(card.prony, ramp_s), 2) for ramp_s in _RAMPS_S)
            yield (f"{label} has no clock, so it is not corrected for rate and counts as long-term: by the series mu_0 "
                   f"is some {fast} too high if it was loaded within {_RAMPS_S[0]:g} s, {slow} if within "
                   f"{_RAMPS_S[1]:g} s. Give its time column.")


def _loss(card: MaterialCard) -> Iterator[str]:
    """What a cycle loses that the law does not have: of tests of which one loading was fitted, and after softening."""
    if card.softening is not None:
        for measured, fitted in card.fit.get("softening", {}).get("lost", ()):
            if measured - fitted > _LOST:
                parts = ["softening", *(["its loop"] if card.softening.loop_share else []),
                         *(["relaxation"] if card.prony is not None else [])]
                has = f"{' and '.join(parts)} {'have' if len(parts) > 1 else 'has'}"
                yield (f"The last cycle loses {percent(measured, 2)} of the work put in, of which {has} "
                       f"{percent(max(fitted, 0.0), 2)}: the rest is not in the law.")
        return
    lost = [(label, row["loss_share"], abs(row.get("residual_strain", 0.0))) for label, row in tests(card).items()
            if row.get("loss_share", 0.0) > _LOST]
    if lost:
        sizes = ", ".join(f"{label} {percent(share, 2)} of the work" + (f" and a set of {left:.3f}" if left else "")
                          for label, share, left in lost)
        yield (f"One loading was fitted and no unloading: a cycle loses {sizes}, of which the law has only what the "
               "Prony series gives." if card.prony is not None else
               f"One loading was fitted and no unloading: a cycle loses {sizes}, which the law does not have.")


def _softened(card: MaterialCard) -> Iterator[str]:
    """A softening at either end of what there is, to no stress at all, or none; and a loop that takes nearly all."""
    if card.softening is None:
        return
    softest = card.fit.get("softening", {}).get("softest", 0.5)
    if softest < _HARDLY:
        yield (f"Unloading falls to {percent(max(softest, 0.0))} of the law's stress: the specimen may have left the "
               "plates, and the numbers of the softening are not determined. Unload more slowly.")
    if softest > 1 - _HARDLY:
        yield (f"Unloading is softer than loading by {percent(1 - softest)} at most: the numbers of the softening mean "
               "nothing.")
    if card.softening.loop_share >= MOST_LOOP - 1e-6:
        yield (f"loop_share ended on the bound of its search, {MOST_LOOP:g}: the cycles are not those of this loop, "
               "for instance since friction keeps a stress at rest. Stresses of other cycles may be far off.")


def _cycled_before(card: MaterialCard) -> Iterator[str]:
    """Later loadings that are corrected for rate as from rest: what the cycles before left unrelaxed is not."""
    if card.prony is None:
        return
    for label, row in tests(card).items():
        if row.get("rate_corrected") and row.get("loadings", 1.0) > 1 and "loading_s" in row:
            off = _left_over(card.prony, row["loading_s"], int(row["loadings"]))
            if off > _LEFT_OVER:
                yield (f"{label} is the last of {row['loadings']:.0f} loadings, corrected for rate as from rest: what "
                       f"cycles like it before it left unrelaxed moves its stress by up to {percent(off, 2)}.")


def _left_over(prony: Prony, loading_s: float, loadings: int) -> float:
    """Largest difference of the stress of a last triangular cycle with those before it and from rest, over its peak."""
    one = np.r_[np.linspace(0, 1, _RAMP_POINTS)[1:], np.linspace(1, 0, _RAMP_POINTS)[1:]]
    cycles = min(loadings, _MOST_CYCLES)
    strain = np.r_[0.0, np.tile(one, cycles)]
    stress = convolve(prony, np.linspace(0, 2 * loading_s * cycles, strain.size), strain)
    last = slice(strain.size - one.size - 1, strain.size - one.size // 2)
    fresh = convolve(prony, np.linspace(0, 2 * loading_s, one.size + 1), np.r_[0.0, one])[:one.size // 2 + 1]
    return float(np.max(np.abs(stress[last] - fresh)) / np.max(np.abs(fresh)))


def _excess(prony: Prony, ramp_s: float) -> float:
    """How much stiffer than in the long term a material is over the small strains of a ramp, its first twentieth."""
    tau, early_s = prony.tau_s, ramp_s / 20
    return float(prony.g @ (-np.expm1(-early_s / tau) * tau / early_s)) / prony.g_infinity


def _series(card: MaterialCard) -> Iterator[str]:
    sd = card.fit.get("prony", {}).get("tau_sd_s")
    if card.prony is None or sd is None:
        return
    rows = tests(card).values()
    relaxing = [row for row in rows if row["kind"] == "relaxation"]
    ramped = any("step_first_s" not in row for row in relaxing)
    if card.law is None and (ramped or not (relaxing or any(row["kind"] in ("dma", "creep") for row in rows))):
        yield ("Relaxation was fitted without a stress-strain curve: the ramp of the test itself had to give the shape "
               "of the curve, on which the fast terms depend.")
    loose = [f"{tau:.3g} s" for tau, error in zip(card.prony.tau_s, sd, strict=True) if error > _LOOSE * tau]
    if loose:
        yield f"Weakly determined relaxation times: {', '.join(loose)}."


def _dynamic(card: MaterialCard) -> Iterator[str]:
    """Sweeps that no linear material has, and shifts that their overlap or their law leaves open."""
    found = card.fit.get("prony", {})
    rms = found.get("relative_rms", {})
    if rms.get("loss", 0.0) > max(_LOSS_OFF, _OFF_RATIO * rms.get("storage", 0.0)):
        yield (f"Storage and loss modulus are not those of one linear material: the series follows the storage modulus "
               f"to {percent(rms['storage'])} and misses the loss modulus by {percent(rms['loss'])} (relative RMS).")
    if (shift := found.get("shift")) is None:
        return

    def at(temperatures: Iterable[float]) -> str:
        return ", ".join(f"{t - 273.15:.4g} C" for t in temperatures)

    if shift["gaps_K"]:
        yield (f"The sweeps at {at(shift['gaps_K'])} do not overlap with those below them after the shift, which is an "
               "extrapolation there: measure at temperatures between, or more frequencies.")
    if shift["disagree_K"]:
        yield (f"Storage and loss modulus shift differently at {at(shift['disagree_K'])}: the storage modulus was "
               "followed. Moduli that change with temperature by themselves, or steps not yet steady, do that.")
    if shift["misfit_decades"] > _SHIFT_OFF:
        kind = "WLF" if isinstance(card.shift, Wlf) else "Arrhenius"
        yield (f"The {kind} law of the shift is {shift['misfit_decades']:.2g} decades off the sweeps' own shifts "
               "(rms): take times at other temperatures from those (fit.prony.shift in the card).")


def _together(card: MaterialCard) -> Iterator[str]:
    """Holds and a dynamic test that one series does not follow as well as each its own."""
    found = card.fit.get("prony", {})
    if (joint := found.get("joint")) is None or not joint["disagree"]:
        return
    rms = {label: own_rms(row) for label, row in tests(card).items()} | found["relative_rms"]
    worse = ", ".join(f"{name} {percent(alone)} alone, {percent(rms[name])} together"
                      for name, alone in joint["relative_rms_alone"].items())
    yield (f"Hold and dynamic test relax differently by more than their errors (relative RMS: {worse}). Another strain "
           "or temperature does that; the series is a compromise. Fit each to a card of its own, or repeat one at the "
           "strain and temperature of the other.")


def _step(card: MaterialCard) -> Iterator[str]:
    """Steps that the record begins after: what relaxed sooner is an extrapolation, and the clock's zero is taken on
    trust."""
    if card.prony is None:
        return
    for label, row in tests(card).items():
        if (first := row.get("step_first_s", 0.0)) > 0:
            left = card.prony.g * np.exp(-first / card.prony.tau_s)
            other = card.prony.g_infinity / (card.prony.g_infinity + left.sum())
            yield (f"{label} begins {first:.4g} s after its step: what relaxed sooner is extrapolated, and the errors "
                   "of g allow for as much again as relaxes in the first tenfold of time. If its first row is the "
                   f"step, subtract {first:.4g} s from its times: g_infinity is then {other:.3g}, not "
                   f"{card.prony.g_infinity:.3g}.")
        if clock := row.get("step_clock_s", 0.0):
            yield (f"{label}: its first row, at {clock:.6g} s, was taken as the step, since its stress falls faster "
                   "there than that of a material does so long after a step.")
        if "step_recorded" in row:
            fallen = card.prony.tau_s / _RAMP_S * -np.expm1(-_RAMP_S / card.prony.tau_s)
            g = card.prony.g / fallen
            whole = card.prony.g_infinity + g.sum()
            if card.prony.g_infinity * (1 - 1 / whole) > _RAMP_COUNTS:
                yield (f"{label} is held from its first row on, so a step was taken there: what was before is not "
                       f"known. If it was a ramp of {_RAMP_S:g} s, g_1 is near {g[0] / whole:.2g}, not "
                       f"{card.prony.g[0]:.2g}, and g_infinity near {card.prony.g_infinity / whole:.3g}, not "
                       f"{card.prony.g_infinity:.3g}: give the record with its ramp.")


def _other_laws(card: MaterialCard, laws: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """How far laws that predict as well are from each other where a touch takes the skin and no test did."""
    skin = card.conductivity
    assert skin is not None
    if (own := next((row for row in laws if row["law"] == skin.kind), None)) is not None and not own["counts"]:
        best = min(laws, key=lambda row: float(row["predicted_rms"]))
        yield (f"Of the third of the conductivities farthest from rest, kept out, the {best['law']} law predicts "
               f"{percent(best['predicted_rms'])} off and the {skin.kind} {percent(own['predicted_rms'])}: outside the "
               f"tests matcal predict gives both, and simulations take the {skin.kind}, which this card holds.")
    if skin.strain_range[0] <= _TOUCHED or not (rows := others(laws, skin.kind)):
        return
    value, *values = (float(c[0]) for c in values_of([skin, *rows], np.array([_TOUCHED])))
    least, most = min(value, *values), max(value, *values)
    if most > _LAWS_DIFFER * max(least, 1e-300):
        yield (f"At a strain of {_TOUCHED:g}, outside the tests, the {skin.kind} has {value:.3g} S/m and laws that "
               f"predict as well ({', '.join(row.kind for row in rows)}) have {least:.3g} to {most:.3g} S/m: measure "
               "the conductivity in compression.")


def _skin(card: MaterialCard) -> Iterator[str]:
    if card.conductivity is None:
        return
    if card.conductivity.strain_range[0] > -0.01:
        yield ("Conductivity was measured in tension only: a touch stretches the skin in its plane; driven through its "
               "thickness (strain = \"normal\"), which a touch compresses, it is extrapolated.")
    found = card.fit.get("conductivity", {})
    yield from _other_laws(card, found.get("laws", ()))
    law = conduction_law(card.conductivity.kind)
    moved = abs(_DOUBTED_ZERO * float(law.slope(card.conductivity.a, np.array(0.0))))
    lo, hi = found.get("c0_interval_S_per_m", (-np.inf, np.inf))
    if not found.get("zero_in_intervals", True) and moved * card.conductivity.c0_S_per_m > (hi - lo) / 2:
        yield (f"The strain zero of the conductivity test is taken as exact: off by {_DOUBTED_ZERO:g} it moves c_0 by "
               f"{percent(moved, 2)}, more than its interval. Give --strain-zero SD where it is not.")
