"""Synthetic machine files of a foam characterisation: `python data_raw/generate.py [FOLDER]` writes them all.

Nothing here was measured: the source paper publishes no raw data. The foam obeys Table 1 of the paper plus three
further hyperfoam terms that make it 2.7 % stiffer at rest, less so at large strain; it relaxes by the paper's Prony
series applied to the second Piola-Kirchhoff stress (quasi-linear viscoelasticity). What a load frame and a potentiostat
add is listed in ERRORS below and, with every number, in truth.json. One seed gives the same bytes every time.
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

SEED = 20240229
MARK = "touchcal-synthetic: 1"  # the line by which matcal knows that nothing was measured
# kPa; the first three terms are Table 1, the others the stiffening that fades with strain
MU = np.array([14.42, 16.78, -21.67, -0.19, 0.64, -0.19])
ALPHA = np.array([0.288, 4.249, 0.741, 2.0, 5.0, 7.0])
G = np.array([0.1505, 0.1696, 0.0604])
TAU = np.array([0.2936, 5.85, 81.672])
C0, A123 = 30.0, np.array([-2.0, 2.0, -1.0])
# mm: compression disc, four shear blocks, coated strip
DISC = {"diameter_mm": 50.0, "height_mm": 20.0}
LAP = {"faces": 4, "length_mm": 25.0, "width_mm": 20.0, "thickness_mm": 10.0}
STRIP = {"length_mm": 75.0, "width_mm": 25.0, "thickness_mm": 10.0, "coating_um": 20.0, "voltage_V": 0.5}
DISC_MM2 = np.pi * DISC["diameter_mm"] ** 2 / 4
LAP_MM2 = LAP["faces"] * LAP["length_mm"] * LAP["width_mm"]
STRIP_MM2 = STRIP["width_mm"] * STRIP["thickness_mm"]
RING_M2 = 2 * (STRIP["width_mm"] + STRIP["thickness_mm"]) * 1e-3 * STRIP["coating_um"] * 1e-6  # corners left out
SPEED = 5 / 60  # mm/s

ERRORS = {
    "load_noise_N": 0.25, "load_step_N": 0.01, "crosshead_noise_mm": 0.0005, "crosshead_step_mm": 0.0005,
    "compliance_mm_per_N": 0.0006, "backlash_mm": 0.05, "toe_width_mm": 0.04,
    "current_noise_A": 8e-7, "current_step_A": 3e-8, "potential_noise_V": 1e-4, "potential_step_V": 3e-4,
    "plain_noise_kPa": 0.045, "settling_fraction": 0.30, "settling_cycles": 2.0,
}
# per file: crosshead reading at the start (mm), gap before contact (mm), load zero (N) and its drift (N/s)
SETUP = {
    "uniaxial": {"start_mm": 141.8725, "gap_mm": 0.31, "zero_N": -1.37, "drift_N_per_s": 0.0009},
    "shear": {"start_mm": 63.2140, "gap_mm": 0.0, "zero_N": 0.84, "drift_N_per_s": -0.0006},
    "relaxation": {"start_mm": 141.6480, "gap_mm": 0.20, "zero_N": -1.12, "drift_N_per_s": 0.0004},
    "cyclic": {"start_mm": 118.0065, "gap_mm": 0.0, "zero_N": 0.46, "drift_N_per_s": 0.0001},
    "stretch": {"start_mm": 118.0310, "gap_mm": 0.0, "zero_N": 0.52, "drift_N_per_s": 0.0002},
}
# potentiostat clock minus frame clock, s
CLOCK = {"cyclic": 1131.938, "stretch": 2247.317}
BREAK_STRAIN = 0.4


def uniaxial_longterm(strain):
    """Nominal stress, kPa, of the foam after all relaxation; lateral stretches stay 1 (nu = 0)."""
    x = np.log1p(strain)[..., None]
    return np.sum(2 * MU / ALPHA * np.expm1(ALPHA * x), axis=-1) / (1 + strain)


def shear_longterm(gamma):
    """(S12, S22) in kPa, second Piola-Kirchhoff, of simple shear after all relaxation; P12 = S12 + gamma S22."""
    x = np.arcsinh(gamma / 2)
    c1, c2 = np.exp(2 * x), np.exp(-2 * x)
    s1, s2 = (np.sum(2 * MU / ALPHA * np.expm1(ALPHA / 2 * np.log(c)[..., None]), axis=-1) / c for c in (c1, c2))
    rest = np.abs(x) < 1e-9
    slope = np.where(rest, np.sum(MU), (s1 - s2) / np.where(rest, 1.0, c1 - c2))
    return gamma * slope, s2 + slope * (1 + gamma**2 - c2)


def relaxing(longterm, dt):
    """Stress history from the equilibrium one, from rest: hereditary integral of longterm/g_inf, exact on ramps."""
    rest = 1 - G.sum()
    step = np.diff(longterm, prepend=0.0) / rest
    out = np.cumsum(step) * rest
    for g, tau in zip(G, TAU, strict=True):
        weight = -np.expm1(-dt / tau) / (dt / tau)
        out = out + g * lfilter([weight], [1.0, -np.exp(-dt / tau)], step)
    return out


def uniaxial_stress(strain, dt):
    return relaxing(uniaxial_longterm(strain) / (1 + strain), dt) * (1 + strain)


def shear_stress(gamma, dt):
    s12, s22 = (relaxing(s, dt) for s in shear_longterm(gamma))
    return s12 + gamma * s22


def play(x, width):
    """What follows a drive with backlash: it moves only once the slack `width` is taken up."""
    out, at = np.empty_like(x), 0.0
    for n, value in enumerate(x):
        at = min(max(at, value - width), value)
        out[n] = at
    return out


def path(points, dt):
    """Times and positions of a piecewise linear motion through (s, mm) points."""
    time = np.arange(round(points[-1][0] / dt) + 1) * dt
    return time, np.interp(time, [p[0] for p in points], [p[1] for p in points])


def loaded(travel, dt, height, area, stress, sign, gap, toe, slack):
    """(strain, force N) of a specimen behind backlash (`slack` of it at the start), gap, toe and machine compliance.

    Sign -1 pushes, and then there is no tension; 1 pulls.
    """
    drive = play(travel + ERRORS["backlash_mm"] - slack, ERRORS["backlash_mm"])
    force = np.zeros_like(travel)
    for _ in range(12):
        moved = drive - gap - ERRORS["compliance_mm_per_N"] * np.abs(force)
        moved = toe * np.logaddexp(0.0, moved / toe) if toe else moved
        strain = sign * moved / height
        force = 1e-3 * area * stress(strain, dt)
        force = np.minimum(force, 0.0) if sign < 0 else force
    return strain, force


def mts_text(name, title, time, travel, force, rng):
    """A TestSuite data acquisition export; travel is down for compression, up otherwise."""
    setup = SETUP[name]
    down = -1.0 if name in ("uniaxial", "relaxation") else 1.0
    crosshead = setup["start_mm"] + down * travel + rng.normal(0, ERRORS["crosshead_noise_mm"], time.size)
    load = force + setup["zero_N"] + setup["drift_N_per_s"] * time + rng.normal(0, ERRORS["load_noise_N"], time.size)
    crosshead = np.round(crosshead / ERRORS["crosshead_step_mm"]) * ERRORS["crosshead_step_mm"]
    load = np.round(load / ERRORS["load_step_N"]) * ERRORS["load_step_N"]
    head = (f"\ufeffFile Path: C:\\Synthetic\\{title}\\Test Run 1\\DAQ- Crosshead, … - (Timed).txt   \n"
            f"Test: SYNTHETIC {title}\nTest Run: Test Run 1\nDate: 2/29/2024 9:00:00 AM\n{MARK}\n\n"
            "Crosshead \tLoad \tTime \nmm\tN\tsec\n")
    rows = (f"{x:.8g}\t{f:.6g}\t{t:.9g}\n" for x, f, t in zip(crosshead, load, np.float32(time + 0.01), strict=True))
    return head + "".join(rows)


def nova_text(time, current, rng):
    """A NOVA export: constant potential, autoranged current, the procedure's clock."""
    current = current + rng.normal(0, ERRORS["current_noise_A"], time.size)
    current = np.round(current / ERRORS["current_step_A"]) * ERRORS["current_step_A"]
    potential = STRIP["voltage_V"] + rng.normal(0, ERRORS["potential_noise_V"], time.size)
    potential = np.round(potential / ERRORS["potential_step_V"]) * ERRORS["potential_step_V"]
    ranges = np.where(np.abs(current) > 1e-4, "1 mA", "100 µA")
    head = "Potential applied (V);Time (s);WE(1).Current (A);WE(1).Potential (V);Index;Current range\n"
    rows = (f"{STRIP['voltage_V']};{t:.12g};{i:.7g};{v:.7g};{n + 1};{r}\n"
            for n, (t, i, v, r) in enumerate(zip(time, current, potential, ranges, strict=True)))
    return head + "".join(rows)


def plain_text(strain, stress, rng):
    noisy = stress + rng.normal(0, ERRORS["plain_noise_kPa"], stress.size)
    head = f"# {MARK}\nstrain,stress\n-,kPa\n"
    return head + "".join(f"{e:.4f},{p:.4f}\n" for e, p in zip(strain, noisy, strict=True))


def resistance(strain, cycles):
    """Ohm: L/(c A) with the current length, and the settling of a fresh coating with the cycles behind it."""
    c = C0 * (1 + strain * (A123[0] + strain * (A123[1] + strain * A123[2])))
    settling = 1 + ERRORS["settling_fraction"] * np.exp(-cycles / ERRORS["settling_cycles"])
    return STRIP["length_mm"] * 1e-3 * (1 + strain) / (c * RING_M2) * settling


def compression(name, rng):
    """Quasi-static compression (ISO 3386-1), or the step and hold of a relaxation (ISO 3384-1)."""
    dt, gap = 0.01, SETUP[name]["gap_mm"]
    stroke = gap + ERRORS["backlash_mm"] + 0.8 * DISC["height_mm"] + 0.028
    if name == "uniaxial":
        top = 5 + stroke / SPEED
        time, travel = path([(0, 0), (5, 0), (top, stroke), (top + stroke / (200 / 60), 0), (top + 15, 0)], dt)
        title = "uniaxial compression ISO 3386-1"
    else:
        time, travel = path([(0, 0), (2, 0), (3, stroke), (183, stroke)], dt)
        travel = lfilter([1 - np.exp(-dt / 0.015)], [1, -np.exp(-dt / 0.015)], travel)  # the actuator's own lag
        title = "stress relaxation in compression ISO 3384-1"
    strain, force = loaded(travel, dt, DISC["height_mm"], DISC_MM2, uniaxial_stress, -1, gap, ERRORS["toe_width_mm"],
                           slack=ERRORS["backlash_mm"])
    return mts_text(name, title, time, travel, force, rng), (time, strain, force / DISC_MM2 * 1e3)


def lap_shear(rng):
    dt, stroke = 0.01, ERRORS["backlash_mm"] + LAP["thickness_mm"]
    time, travel = path([(0, 0), (5, 0), (5 + stroke / SPEED, stroke)], dt)
    gamma, force = loaded(travel, dt, LAP["thickness_mm"], LAP_MM2, shear_stress, 1, 0.0, 0.0,
                          slack=ERRORS["backlash_mm"])
    return mts_text("shear", "quadruple lap shear ISO 1827", time, travel, force, rng), (time, gamma,
                                                                                        force / LAP_MM2 * 1e3)


def strip(name, frame_rng, pot_rng):
    """Coated strip under 0.5 V: ten cycles of 4 mm, then the stretch to failure; two machines, two clocks."""
    dt, pot_dt = 0.1, (0.5 if name == "cyclic" else 0.2)
    if name == "cyclic":
        turn = 4 / SPEED
        points = [(0, 0), (8, 0)] + [(8 + turn * n, 4.0 * (n % 2)) for n in range(1, 21)] + [(8 + 20 * turn + 5, 0)]
    else:
        top = BREAK_STRAIN * STRIP["length_mm"] + 0.005
        points = [(0, 0), (8, 0), (8 + top / SPEED, top), (8 + (top + 0.5) / SPEED, top + 0.5)]
    time, travel = path(points, dt)
    strain, force = loaded(travel, dt, STRIP["length_mm"], STRIP_MM2, uniaxial_stress, 1, 0.0, 0.0, slack=0.0)
    seen = np.arange(-20.0, time[-1] - 1, pot_dt) + 0.037  # the potentiostat starts 20 s before the frame
    along = np.interp(seen, time, strain)
    cycles = np.interp(seen, [8, points[-2][0]], [0, 10]) if name == "cyclic" else np.full(seen.size, 1e3)
    current = STRIP["voltage_V"] / resistance(along, cycles)
    if name == "stretch":
        torn = time[np.argmax(strain >= BREAK_STRAIN)]
        force, current = np.where(time >= torn, 0.0, force), np.where(seen >= torn, 0.0, current)
    title = "cyclic stretch of coated strip" if name == "cyclic" else "stretch to failure of coated strip"
    frame = mts_text(name, f"conductivity - {title}", time, travel, force, frame_rng)
    return frame, nova_text(seen + 0.01 + CLOCK[name], current, pot_rng)


def step_and_hold():
    """Strain, stress for the plain files: each step held for 20 minutes, so the stress is the equilibrium one."""
    e, gamma = -np.arange(1, 81) / 100, np.arange(1, 51) / 50
    s12, s22 = shear_longterm(gamma)
    return {"uniaxial": (e, uniaxial_longterm(e)), "shear": (gamma, s12 + gamma * s22)}


def specimen_text():
    table = {"uniaxial": DISC | {"compliance_mm_per_N": ERRORS["compliance_mm_per_N"]},
             "relaxation": DISC | {"compliance_mm_per_N": ERRORS["compliance_mm_per_N"]},
             "shear": LAP | {"compliance_mm_per_N": ERRORS["compliance_mm_per_N"]}, "conductivity": STRIP}
    parts = [f"[{kind}]\n" + "".join(f"{k} = {v}\n" for k, v in keys.items()) for kind, keys in table.items()]
    return "# Specimens of the synthetic files in this folder.\n" + "\n".join(parts)


def rounded(values, digits=7):
    return [float(f"{v:.{digits}g}") for v in np.atleast_1d(values)]


def sampled(name, time, strain, stress):
    """A noise-free history at 100 equal steps of strain; a relaxation also at 60 logarithmic steps of time."""
    size = np.abs(strain[:np.argmax(np.abs(strain)) + 1])
    pick = np.searchsorted(size, np.linspace(0.01, 1, 100) * size[-1])
    if name == "relaxation":
        pick = np.union1d(pick, np.searchsorted(time, np.geomspace(3, time[-1], 60)))
    pick = np.unique(np.minimum(pick, time.size - 1))
    return {"time_s": rounded(time[pick] + 0.01), "strain": rounded(strain[pick]), "stress_kPa": rounded(stress[pick])}


def truth(histories):
    """Everything that a reduction or a calibration should give back."""
    e, gamma, table_1 = -np.linspace(0, 0.8, 41), np.linspace(0, 1, 41), MU[:3].sum()
    s12, s22 = shear_longterm(gamma)
    return {
        "synthetic": True, "seed": SEED,
        "longterm": {"mu_kPa": MU.tolist(), "alpha": ALPHA.tolist(), "beta": [0.0] * 6,
                     "mu_0_kPa": rounded(MU.sum())[0], "table_1_mu_0_kPa": rounded(table_1)[0],
                     "uniaxial": {"strain": rounded(e), "stress_kPa": rounded(uniaxial_longterm(e))},
                     "shear": {"gamma": rounded(gamma), "stress_kPa": rounded(s12 + gamma * s22)}},
        "prony": {"g": G.tolist(), "tau_s": TAU.tolist()},
        "conductivity": {"c0_S_per_m": C0, "a": A123.tolist(), "ring_area_m2": RING_M2, "break_strain": BREAK_STRAIN},
        "tests_at_5_mm_per_min_and_relaxation": {name: sampled(name, *h) for name, h in histories.items()},
        "errors": ERRORS, "setup": SETUP, "clock_potentiostat_minus_frame_s": CLOCK,
    }


def build():
    """File name -> text."""
    rngs = [np.random.default_rng([SEED, n]) for n in range(9)]
    files = {f"{name}.csv": plain_text(strain, stress, rngs[n])
             for n, (name, (strain, stress)) in enumerate(step_and_hold().items())}
    histories = {}
    for n, name in ((2, "uniaxial"), (3, "relaxation")):
        files[f"mts_{name}.txt"], histories[name] = compression(name, rngs[n])
    files["mts_shear.txt"], histories["shear"] = lap_shear(rngs[4])
    files["mts_cyclic.txt"], files["nova_cyclic.txt"] = strip("cyclic", rngs[5], rngs[6])
    files["mts_stretch.txt"], files["nova_stretch.txt"] = strip("stretch", rngs[7], rngs[8])
    files["specimen.toml"] = specimen_text()
    files["truth.json"] = json.dumps(truth(histories), indent=1) + "\n"
    return files


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    sums = []
    for name, text in sorted(build().items()):
        data = text.encode("utf-8")
        (folder / name).write_bytes(data)
        sums.append(f"{hashlib.sha256(data).hexdigest()}  {name}\n")
    (folder / "SHA256SUMS").write_bytes("".join(sums).encode())


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
