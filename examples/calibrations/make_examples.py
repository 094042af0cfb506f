"""The tables of this directory, made from a planted truth with a seed: python examples/calibrations/make_examples.py

Every truth stands in the comment of the sheet beside its table; KIND-planted is KIND with a planted fault, which the
comment names. The simulation writes down phases as the instrument would show them; it uses the index of air and nothing
else of the calibrations.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.atmosphere.index.air import group_refractivity, phase_refractivity

HERE = Path(__file__).parent
C, F = 299_792_458.0, 1500e6
MJD = 61_280.5  # 2026-09-01, noon UTC

PROVENANCE = """kind = "{kind}"
instrument = "{instrument}"
serial = "example-103"
measured_on = 2026-09-01
valid_until = 2028-09-01
by = "example"
report = "examples/calibrations/make_examples.py"
"""
AIR = """modulation_hz = 1.5e9
u_modulation_ppm = 0.01     # rubidium
temperature_c = 20.4
pressure_hpa = 931.2
humidity_percent = 47.0
u_temperature_c = 0.1       # offset of the sensor, shared by all readings
u_pressure_hpa = 0.3
u_humidity_percent = 2.0
"""


def index() -> float:
    return 1.0 + float(group_refractivity(20.4, 931.2, 47.0))


def half() -> float:
    return 0.5 * C / (index() * F)


def wrapped(phase: np.ndarray) -> np.ndarray:
    return np.mod(phase, 2 * np.pi)


@dataclass(frozen=True)
class Example:
    """One table and its sheet.

    truth     lines of the sheet's comment
    sheet     what it says beside the provenance
    columns   cells of the table, as they are written
    fault     the planted fault, in words for the comment; "" where there is none
    """

    kind: str
    truth: str
    sheet: str
    columns: dict[str, list]
    fault: str = ""
    instrument: str = "ZP103"
    provenance: str = PROVENANCE


def write(example: Example, folder: Path = HERE) -> None:
    """KIND.csv and KIND.toml, or KIND-planted where a fault is planted."""
    name = example.kind + ("-planted" if example.fault else "")
    rows = zip(*example.columns.values(), strict=True)
    text = [",".join(example.columns), *(",".join(str(v) for v in row) for row in rows)]
    (folder / f"{name}.csv").write_text("\n".join(text) + "\n", encoding="utf-8")
    said = f"{example.truth}\n{example.fault}".strip().splitlines()
    provenance = example.provenance.format(kind=example.kind, instrument=example.instrument)
    head = "".join(f"# {line}\n" for line in said) + provenance
    (folder / f"{name}.toml").write_text(head + example.sheet, encoding="utf-8")


def reference_distance(rng: np.random.Generator, planted: bool = False) -> Example:
    d0 = 180.685e-3
    # Ten places spread over half a wavelength at 3 m, ten over 30 m.
    distance = np.concatenate([3.0 + 0.0107 * np.arange(10), np.linspace(4.0, 30.0, 10)])
    true = distance + 4e-6 * rng.standard_normal(20)
    electronics = 1.1 + np.cumsum(2e-3 * rng.standard_normal(20))  # radians, drifting from reading to reading
    reference = electronics
    target = electronics - 2 * np.pi * (true - d0) / half()  # phase falls as distance grows
    noise = 2e-4 * rng.standard_normal((2, 20))
    if planted:
        target[13] += 0.004  # a person walked through the beam
    return Example(
        "reference-distance",
        "Truth: D0 = 180.685 mm, hollow target.",
        AIR
        + """d0_nominal_mm = 181.0       # from the drawing: decides the whole cycles
u_d0_nominal_mm = 1.0
pc_mm = 0.0                 # hollow target
u_distance_mm = 0.004       # setting of the target, each by itself
u_distance_common_mm = 0.005  # scan point to the zero of the scale
u_distance_ppm = 0.3        # interferometer that made the scale
u_phase_rad = 0.00028       # of the difference of two phases
u_leakage_volt = 0.0008
""",
        {
            "distance_m": [f"{v:.6f}" for v in distance],
            "phase_target_rad": [f"{v:.5f}" for v in wrapped(target + noise[0])],
            "phase_reference_rad": [f"{v:.5f}" for v in wrapped(reference + noise[1])],
            "amplitude_target_volt": [f"{v:.3f}" for v in 4.0 - 0.05 * distance],
            "amplitude_reference_volt": ["5.000"] * 20,
        },
        fault="Reading 14 (line 15) is wrong by +4 mrad of phase, -64 um of range." if planted else "",
    )


def leakage(rng: np.random.Generator, planted: bool = False) -> Example:
    truth = 0.03104 * np.exp(1j * 4.3574)
    rows = []
    for session in range(6):
        shift = 4e-4 * (rng.standard_normal() + 1j * rng.standard_normal())
        for buffer in range(8):
            noise = 2.5e-4 * (rng.standard_normal() + 1j * rng.standard_normal())
            rows.append((f"h{8 + 2 * session:02d}", MJD + session / 12 + buffer / 1440, truth + shift + noise))
    z = np.array([r[2] for r in rows])
    if planted:
        z[29] += 0.004  # a light was on
    return Example(
        "leakage",
        "Truth: 0.03104 V at 4.3574 rad; 0.25 mV of noise in each quadrature of a buffer, 0.40 mV between sessions.",
        "",
        {
            "session": [r[0] for r in rows],
            "mjd_utc": [f"{r[1]:.6f}" for r in rows],
            "real_volt": [f"{v:.6f}" for v in z.real],
            "imaginary_volt": [f"{v:.6f}" for v in z.imag],
        },
        fault="Reading 30 (line 31) holds 4 mV of stray light in its real part." if planted else "",
    )


def leakage_lit(rng: np.random.Generator, planted: bool = False) -> Example:
    truth = 0.03104 * np.exp(1j * 4.3574)
    distance = 5.0 + 0.0061 * np.arange(40)
    light = (2.0 - 0.3 * (distance - 5.0)) * np.exp(1j * (0.7 - 2 * np.pi * distance / half()))
    z = truth + light + 4e-4 * (rng.standard_normal(40) + 1j * rng.standard_normal(40))
    return Example(
        "leakage-lit",
        "Truth: leakage 0.03104 V at 4.3574 rad; the light of 2 V fades by 15 % a metre; 0.4 mV of noise.",
        f"group_index = {index():.8f}\nu_session_volt = 0.0004     # from readings with the beam blocked\n",
        {
            "distance_m": [f"{v:.4f}" for v in distance],
            "amplitude_volt": [f"{v:.6f}" for v in np.abs(z)],
            "phase_rad": [f"{v:.6f}" for v in wrapped(np.angle(z))],
        },
    )


def linearity(rng: np.random.Generator, planted: bool = False) -> Example:
    d0, start = 180.685e-3, 2.4
    length = np.linspace(0.0, 1.5, 121) + 1e-3 * rng.uniform(-1, 1, 121)
    phase_index = 1.0 + float(phase_refractivity(20.4, 931.2, 47.0, wavelength_um=0.63299))
    vacuum = length * phase_index + 2e-7 * rng.standard_normal(121)
    cosine, sine = np.array([6.0e-6, -2.5e-6]), np.array([-9.0e-6, 1.5e-6])
    zero, scale = 35e-6, 0.4e-6
    distance = start + length
    range_ = zero + (1 + scale) * distance
    for _ in range(3):  # the phase is that of the range as it reads
        x = -2 * np.pi * (range_ - d0) / half()
        wave = sum(cosine[k] * np.cos((k + 1) * x) + sine[k] * np.sin((k + 1) * x) for k in range(2))
        range_ = zero + (1 + scale) * distance + wave
    minutes = 1.5 * np.arange(121)
    walk = np.cumsum(np.concatenate([[0.0], 1e-6 * np.sqrt(1.5 / 60) * rng.standard_normal(120)]))
    range_ = range_ + walk + 1.5e-6 * rng.standard_normal(121)
    if planted:
        range_[77] += 25e-6
    return Example(
        "linearity",
        "Truth: zero +35 um, scale +0.4 ppm; cyclic order 1: cosine +6 um, sine -9 um, order 2: cosine -2.5 um, sine\n"
        "+1.5 um; 1.5 um of noise, a drift that walks by 1 um per square root of an hour.",
        AIR
        + """d0_mm = 180.685             # what the ranges contain
pc_mm = 0.0
interferometer_wavelength_um = 0.63299
dead_path_m = 0.35
u_interferometer_ppm = 0.1
u_abbe_mm = 0.0005          # pitch of the carriage
start_m = 2.4               # from the scan point to the target at the interferometer's zero
u_start_mm = 0.008
u_range_mm = 0.0015
random_walk_mm_per_sqrt_hour = 0.001
""",
        {
            "mjd_utc": [f"{v:.7f}" for v in MJD + minutes / 1440],
            "interferometer_vacuum_m": [f"{v:.8f}" for v in vacuum],
            "range_m": [f"{v:.7f}" for v in range_],
        },
        fault="Reading 78 (line 79) is 25 um too long." if planted else "",
    )


def retroreflector(rng: np.random.Generator, planted: bool = False) -> Example:
    rows = []
    for k, name in enumerate(["HOLLOW-1", "ball-7", "prism-12"] * 6):
        seat = 2e-6 * rng.standard_normal()
        for reading in range(4):
            hours = 0.25 * k + reading / 120
            excess = {"HOLLOW-1": 0.0, "ball-7": 0.173715, "prism-12": 0.0334937}[name]
            value = 6.2017 + excess + 3e-6 * hours + seat + 3e-6 * rng.standard_normal()
            rows.append((MJD + hours / 24, name, value))
    if planted:
        rows[41] = (rows[41][0], rows[41][1], rows[41][2] + 60e-6)
    return Example(
        "retroreflector",
        "Truth: ball-7 -173.715 mm, prism-12 -33.4937 mm; a drift of 3 um/h, 2 um of seating, 3 um of reading.",
        """reference = "HOLLOW-1"
pc_mm = 0.0
u_pc_mm = 0.002
u_cyclic_mm = 0.002
""",
        {
            "mjd_utc": [f"{r[0]:.7f}" for r in rows],
            "retroreflector": [r[1] for r in rows],
            "range_m": [f"{r[2]:.7f}" for r in rows],
        },
        instrument="seat-B",
        fault="Reading 42 (line 43) is 60 um too long." if planted else "",
    )


def amplitude(rng: np.random.Generator, planted: bool = False) -> Example:
    level = np.repeat(np.geomspace(0.15, 5.0, 8), 4)
    rng.shuffle(level)
    electronics = 2.0 + np.cumsum(1e-3 * rng.standard_normal(32))
    target = electronics + 0.9 - 1.8e-3 * np.log(level / 5.0) + 3e-4 / level * rng.standard_normal(32)
    reference = electronics + 3e-4 / 5.0 * rng.standard_normal(32)
    if planted:
        target[9] += 0.05
    return Example(
        "amplitude-to-phase",
        "Truth: -1.8 mrad a factor e; 0.3 mV of noise in each quadrature of a phasor.",
        """reference_amplitude_volt = 5.0
u_phasor_volt = 0.0003
u_leakage_volt = 0.0002
""",
        {
            "amplitude_target_volt": [f"{v:.4f}" for v in level],
            "phase_target_rad": [f"{v:.5f}" for v in wrapped(target)],
            "amplitude_reference_volt": ["5.0000"] * 32,
            "phase_reference_rad": [f"{v:.5f}" for v in wrapped(reference)],
        },
        fault="Reading 10 (line 11) is 50 mrad too high." if planted else "",
    )


def second_pass(rng: np.random.Generator, planted: bool = False) -> Example:
    share, angle, coupling = 6e-4, 2.1, -1.2e-3
    place = 12.0 + np.arange(24) * 0.11 / 24 + 1e-3 * rng.uniform(-1, 1, 24)
    turn = -2 * np.pi * place / half()
    full = 5.2 * (1.0 + 0.02 * rng.standard_normal(24))
    electronics = 1.1 + np.cumsum(1e-3 * rng.standard_normal(24))
    columns: dict[str, list[str]] = {}
    for level, volts in (("full", full), ("attenuated", full / 3.1)):
        glass = 0.031 if level == "attenuated" else 0.0
        light = volts * np.exp(1j * (turn + coupling * np.log(volts / 5.0) - glass))
        passes = volts * share * np.exp(-1j * angle) * np.exp(1j * turn)
        seen = sum(light * passes**k for k in range(6)) * np.exp(1j * electronics)
        seen = seen + 3e-4 * (rng.standard_normal(24) + 1j * rng.standard_normal(24))
        phase = np.angle(seen)
        if planted and level == "full":
            phase[15] += 5e-3
        columns[f"phase_{level}_rad"] = [f"{v:.6f}" for v in wrapped(phase)]
        columns[f"amplitude_{level}_volt"] = [f"{v:.4f}" for v in np.abs(seen)]
    columns["phase_reference_rad"] = [f"{v:.6f}" for v in wrapped(electronics)]
    return Example(
        "second-pass",
        "Truth: a second pass of 6e-4 for each volt at an angle of 2.1 rad, that is cosine 5.179e-4, sine 3.029e-4;\n"
        "the phase falls by 1.2 mrad a factor e of amplitude, the attenuator's glass delays it by 31 mrad; 0.3 mV of\n"
        "noise in each quadrature of a phasor.",
        "u_phasor_volt = 0.0003\nu_leakage_volt = 0.0001\n",
        columns,
        fault="Reading 16 (line 17) is 5 mrad too high at the full return." if planted else "",
    )


def feedback(rng: np.random.Generator, planted: bool = False) -> Example:
    level = np.repeat([5.0, 2.0, 0.8], 40)
    fringe = 2 * np.pi * rng.uniform(0, 1, 120)
    electronics = 0.4 + np.cumsum(1e-3 * rng.standard_normal(120))
    target = electronics + np.repeat([1.0, 1.3, 1.7], 40) + 8e-4 * np.sqrt(2) * np.cos(fringe)
    target = target + 3e-4 / level * rng.standard_normal(120)
    reference = electronics + 3e-4 / 5.0 * rng.standard_normal(120)
    return Example(
        "feedback",
        "Truth: 0.8 mrad rms by a fringe of its own phase each reading; 0.3 mV of noise in each quadrature.",
        "u_phasor_volt = 0.0003\n",
        {
            "set": [f"attenuation-{k}" for k in (1, 2, 3) for _ in range(40)],
            "phase_target_rad": [f"{v:.6f}" for v in wrapped(target)],
            "amplitude_target_volt": [f"{v:.4f}" for v in level],
            "phase_reference_rad": [f"{v:.6f}" for v in wrapped(reference)],
            "amplitude_reference_volt": ["5.0000"] * 120,
        },
        fault="",
    )


def oscillator(rng: np.random.Generator, planted: bool = False) -> Example:
    count = 8192
    time = np.arange(count) * 1e-3
    walk = np.cumsum(2e-4 * rng.standard_normal(count))
    phase = 2.0 + 0.012 * rng.standard_normal(count) + walk
    if planted:
        phase = phase + 2.5e-3 * np.sin(2 * np.pi * 57.0 * time + 0.4)
    return Example(
        "oscillator",
        "Truth: 12 mrad of white noise a cycle, a walk by 0.2 mrad a cycle.\n"
        "Phases of single cycles (SEQ) of the internal cube at an IF of 1 kHz.",
        "interval_s = 0.001\nhalf_wavelength_mm = 99.906\ncycles_per_range = 128\n",
        {"phase_rad": [f"{v:.5f}" for v in wrapped(phase)]},
        fault="A line of 2.5 mrad at 57 Hz (a maser's)." if planted else "",
    )


def repeatability(rng: np.random.Generator, planted: bool = False) -> Example:
    names = [f"pointing-{k}" for k in range(1, 9) for _ in range(6)]
    shift = np.repeat((15e-6 if planted else 0.0) * rng.standard_normal(8), 6)
    range_ = 101.2345 + shift + 10e-6 * rng.standard_normal(48)
    return Example(
        "repeatability",
        "Truth: 10 um within a pointing, none from pointing to pointing.",
        "",
        {"set": names, "range_m": [f"{v:.6f}" for v in range_]},
        fault="15 um from pointing to pointing." if planted else "",
    )


GLASS = """index_ratio = 1.527077      # old BK 7 at 0.780 um, group index over that of air
u_index_ratio = 1e-5
expansion_ppm_per_c = 7.1
u_expansion_ppm_per_c = 0.2
temperature_c = 22.5
u_temperature_c = 0.3
u_gauge_mm = 0.001
"""
STEEL = """expansion_ppm_per_c = 11.5
u_expansion_ppm_per_c = 0.6
u_temperature_c = 0.1
"""


def prism(rng: np.random.Generator, planted: bool = False) -> Example:
    height = 38.204 * (1 + 7.1e-6 * 2.5) + 0.0015 * rng.standard_normal(10)
    if planted:
        height[3] += 0.02
    return Example(
        "prism-constant",
        "Truth: height 38.2040 mm at 20 C; 1.5 um of reading.",
        GLASS,
        {"height_mm": [f"{v:.4f}" for v in height]},
        instrument="DP-0412",
        fault="Reading 4 (line 5) is 20 um too long: dust." if planted else "",
    )


def ball(rng: np.random.Generator, planted: bool = False) -> Example:
    part = ["r1", "r2"] * 8
    radius = np.array([50.0126, 96.4946] * 8) * (1 + 7.1e-6 * 2.5) + 0.002 * rng.standard_normal(16)
    return Example(
        "ball-constant",
        "Truth: small ball 50.0126 mm, shell 96.4946 mm at 20 C; 2 um of reading.",
        GLASS,
        {"part": part, "radius_mm": [f"{v:.4f}" for v in radius]},
        instrument="TR07-B",
    )


def gauge_blocks(rng: np.random.Generator, planted: bool = False) -> Example:
    certified = {"100": 100.00021, "50": 49.99990, "25": 25.00004, "10": 10.00001}
    stacks = ["10", "25", "25+10", "50", "50+25", "100", "100+25", "100+50", "100+50+25", "100+50+25+10"] * 2
    temperature = 20.8 + 0.02 * np.arange(20)
    films = np.array([0.00002 * stack.count("+") for stack in stacks])
    length = np.array([sum(certified[name] for name in stack.split("+")) for stack in stacks]) + films
    reads = 0.0042 + length * (1 + 11.5e-6 * (temperature - 20)) * (1 + 18e-6) + 4e-4 * rng.standard_normal(20)
    if planted:
        reads[12] += 0.006
    blocks = "".join(f'\n[[block]]\nname = "{n}"\nlength_mm = {v}\nu_mm = 0.00008\n' for n, v in certified.items())
    return Example(
        "gauge-blocks",
        "Truth: a height gauge that reads 4.2 um and 18 ppm too much; 0.4 um of reading.",
        STEEL + "film_um = 0.02              # of each film where two blocks are wrung\nu_film_um = 0.01\n" + blocks,
        {
            "blocks": stacks,
            "reads_mm": [f"{v:.4f}" for v in reads],
            "temperature_c": [f"{v:.2f}" for v in temperature],
        },
        instrument="height-gauge-2",
        fault="Reading 13 (line 14) is 6 um too long." if planted else "",
    )


def spacers(rng: np.random.Generator, planted: bool = False) -> Example:
    true = {"A": 88.9003, "B": 30.0121, "C": 10.0008}
    names = list(true) * 5
    length = np.array([true[name] for name in names]) * (1 + 11.5e-6 * 0.9)
    reads = 0.0042 + length * (1 + 18e-6) + 4e-4 * rng.standard_normal(15)
    return Example(
        "spacers",
        "Truth: spacers A 88.9003, B 30.0121, C 10.0008 mm at 20 C, by the height gauge of gauge-blocks.csv.",
        STEEL + "temperature_c = 20.9\nzero_mm = 0.0042\nu_zero_mm = 0.0003\nscale_ppm = 18.0\nu_scale_ppm = 4.0\n",
        {"spacer": names, "reads_mm": [f"{v:.4f}" for v in reads]},
        instrument="spacer-set-1",
    )


def invar_wire(rng: np.random.Generator, planted: bool = False) -> Example:
    tension = np.array([100.0, 100.0, 110.0, 110.0, 120.0, 120.0, 100.0, 110.0, 120.0, 100.0])
    temperature = 17.0 + 0.3 * np.arange(10)
    weight, stiffness, rise, distance = 0.1734, 4.15e5, 0.412, 24.0031
    # A parabola's sag and Hooke's stretch: good to a micrometre here, and nothing that catseye computes with.
    chord = 24.0 * (1 + (tension - 100.0) / stiffness + 0.6e-6 * (temperature - 20.0))
    sag = 24.0**3 * weight**2 / 24.0 * (1 / 100.0**2 - np.cos(rise / 24.0) ** 2 / tension**2)
    scale = (distance - chord - sag) * 1e3 + 0.02 * rng.standard_normal(10)
    if planted:
        scale[6] += 0.5
    return Example(
        "invar-wire",
        "Truth: 24.003100 m between the marks; 20 um of reading.",
        f"""certified_mm = 24000.0
u_certified_mm = 0.010
certified_tension_n = 100.0
hanging = true
weight_n_per_m = {weight}
u_weight_n_per_m = 0.0002
stiffness_n = {stiffness}
u_stiffness_n = 4000.0
expansion_ppm_per_c = 0.6
u_expansion_ppm_per_c = 0.1
u_tension_n = 0.05
u_temperature_c = 0.3
height_difference_mm = {rise * 1e3}
u_height_difference_mm = 0.5
u_scale_sum_mm = 0.005
""",
        {
            "tension_n": tension,
            "temperature_c": [f"{v:.1f}" for v in temperature],
            "scale_sum_mm": [f"{v:.3f}" for v in scale],
        },
        instrument="wire-24",
        fault="Reading 7 (line 8) is a misread half millimetre." if planted else "",
    )


def reference_cube(rng: np.random.Generator, planted: bool = False) -> Example:
    steps = np.arange(-240.0, 241.0, 40.0)
    scans = [(steps, np.zeros(13), "up"), (steps[::-1], np.zeros(13), "down")]
    scans += [(np.full(13, 12.0), steps, "up"), (np.full(13, 12.0), steps[::-1], "down")]
    azimuth, elevation = (np.round(np.concatenate([s[k] for s in scans])) for k in (0, 1))
    sense = [s[2] for s in scans for _ in steps]
    lag = 1.5 * np.where(np.array(sense) == "up", 1.0, -1.0)  # play of 3 counts: the axis lags behind the counts
    off = (azimuth - lag - 9.4) / 95.0, (elevation - lag + 14.7) / 110.0
    volts = 5.2 * np.exp(-0.5 * (off[0] ** 2 + off[1] ** 2)) + 0.012 * rng.standard_normal(52)
    if planted:
        volts[19] += 0.4
    return Example(
        "reference-cube",
        "Truth: azimuth 40 191.4 counts, elevation 26 032.3, play 3 counts, peak 5.2 V.",
        "u_amplitude_volt = 0.012\nu_counts = 0.5\n",
        {
            "azimuth_counts": [f"{v + 40182:.0f}" for v in azimuth],
            "elevation_counts": [f"{v + 26047:.0f}" for v in elevation],
            "amplitude_volt": [f"{max(v, 0.0):.3f}" for v in volts],
            "sense": sense,
        },
        fault="Reading 20 (line 21) is 0.4 V too high." if planted else "",
    )


def mounting_plate(rng: np.random.Generator, planted: bool = False) -> Example:
    second = 1.0 / 3600.0
    zero, collimation = 213.4567, 11.0 * second
    blocks = {"target-A": 41.2035, "target-B": 131.7780}
    rows = [(s, t, f) for s in range(1, 7) for t in blocks for f in ("left", "right")]
    seat = dict(zip(range(1, 7), 2.5 * second * rng.standard_normal(6), strict=True))
    wrong = dict(zip(blocks, 1.5 * second * rng.standard_normal(2), strict=True))
    directions = []
    for s, t, f in rows:
        side = 1.0 if f == "left" else -1.0
        reads = zero + seat[s] - blocks[t] - wrong[t] + side * collimation + (0.0 if side > 0 else 180.0)
        directions.append((reads + 1.2 * second * rng.standard_normal()) % 360.0)
    if planted:
        directions[10] += 20.0 * second
    references = "".join(
        f'\n[[reference]]\nname = "{name}"\nv_block_deg = {block}      # v-block clockwise from it\n'
        "u_v_block_arcsec = 1.5\n"
        for name, block in blocks.items()
    )
    return Example(
        "mounting-plate",
        "Truth: the circle reads 213.4567 deg towards the v-block, collimation 11 arcsec, a seating scatters by 2.5.",
        "u_direction_arcsec = 1.2\n" + references,
        {
            "seating": [f"seating-{s}" for s, _, _ in rows],
            "target": [t for _, t, _ in rows],
            "face": [f for _, _, f in rows],
            "direction_deg": [f"{v:.5f}" for v in directions],
        },
        instrument="plate KP2",
        fault="Reading 11 (line 12) is 20 arcsec too high." if planted else "",
    )


MAKERS = (
    reference_distance,
    leakage,
    leakage_lit,
    linearity,
    retroreflector,
    amplitude,
    oscillator,
    prism,
    ball,
    gauge_blocks,
    spacers,
    invar_wire,
    repeatability,
    second_pass,
    feedback,
    reference_cube,
    mounting_plate,
)  # the place of each is its seed


def write_all(makers, seed: int) -> None:
    """Each example as it is and, where its maker has one, with its fault."""
    for number, make in enumerate(makers):
        write(make(np.random.default_rng(seed + number)))
        faulty = make(np.random.default_rng(seed + number), planted=True)
        if faulty.fault:
            write(faulty)


if __name__ == "__main__":
    write_all(MAKERS, 4200)
