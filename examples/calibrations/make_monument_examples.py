"""The tables of monuments in this directory, from a planted truth with a seed: python make_monument_examples.py

Every truth stands in the comment of the sheet beside its table. Where the plumb line and Polaris point is taken from
`catseye.geometry`; nothing of the calibrations is used.
"""

from itertools import pairwise

import numpy as np
from make_examples import Example, write

from catseye.geometry.frames.local_frame import PINTLE_LATITUDE, PINTLE_LONGITUDE, LocalFrame
from catseye.geometry.frames.plumb import astronomic, azimuth, plumb_from_ground, zenith_angle
from catseye.geometry.mirror.mount import gamma
from catseye.geometry.sky.star import POLARIS, star_place

ARCSECOND = np.pi / 648_000
FRAME = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, 775.42, xi=2.1 * ARCSECOND, eta=-3.4 * ARCSECOND)
PLACE = np.array([-85.312, -84.107, 2.431])
MJD = 61_285.0  # 2026-09-06 0h UTC
DEFLECTION = """xi_arcsec = 2.1              # deflection of the vertical, chosen
eta_arcsec = -3.4
u_deflection_arcsec = 0.5
"""
AT = "x_mm = -85312.0\ny_mm = -84107.0\nz_mm = 2431.0\n"


WHO = """kind = "{kind}"
instrument = "{instrument}"
serial = "example"
measured_on = 2026-09-06
valid_until = 2028-09-06
by = "example"
report = "examples/calibrations/make_monument_examples.py"
"""


def monument_azimuth(rng: np.random.Generator) -> Example:
    true, offset = np.radians(45.4087), np.array([0.012, 0.246, 0.031])
    points = {"ZY106": np.array([-119.4, 12.2, 1.9]), "ZY101": np.array([29.504, 115.942, 0.149])}
    collimation, trunnion, drift, v_block = 12 * ARCSECOND, -8 * ARCSECOND, 1.6 * ARCSECOND, np.pi / 2
    plumb = plumb_from_ground(FRAME, PLACE)
    origin = PLACE + gamma(np.pi - true, 0.0, 0.0).T @ offset
    to_z = float(azimuth(plumb @ [np.sin(true), np.cos(true), 0.0]))
    rows = []

    def look(target: str, place: str, hour: float, turned: float, zenith: float) -> None:
        side = collimation / np.sin(zenith) + trunnion / np.tan(zenith)
        shown = turned + 0.6 + drift * (hour + 4.0) / 8.0
        for face, sign, half in (("left", 1.0, 0.0), ("right", -1.0, np.pi)):
            reading = shown + sign * side + half + 0.7 * ARCSECOND * rng.standard_normal()
            rows.append(
                (target, place, face, f"{MJD + hour / 24:.6f}", f"{np.degrees(np.mod(reading, 2 * np.pi)):.5f}")
            )

    for hour in (-4.0, -3.95):
        look("M102", "before", hour, -v_block, np.pi / 2)
    for turn in range(4):
        for k, (name, at) in enumerate(points.items()):
            sight = plumb @ (at - origin)
            look(name, "field", 0.1 * turn + 0.02 * k, float(azimuth(sight)) - to_z, float(zenith_angle(sight)))
        hour = 0.1 * turn + 0.06
        latitude, longitude = astronomic(FRAME, PLACE)
        at, zenith = star_place(POLARIS, MJD + hour / 24, latitude, longitude=longitude, height=778.0, ut1_utc=0.12)
        look("Polaris", "field", hour, float(at) - to_z, float(zenith))
    for hour in (4.0, 4.05):
        look("M102", "after", hour, -v_block, np.pi / 2)
    names = ("target", "place", "face", "mjd_utc", "direction_deg")
    return Example(
        "monument-azimuth",
        'Truth: z^ at the azimuth 45.4087 degrees, alpha1 = pi - azimuth. 0.7" of noise in a reading, collimation\n'
        '12", trunnion -8", the circle moves against the mount by 1.6" from lab to lab. UT1 - UTC = 0.12 s.',
        AT
        + DEFLECTION
        + """u_x_mm = 0.1
u_y_mm = 0.1
u_z_mm = 0.1
instrument_dx_mm = 12.0      # where the theodolite's axes meet, from the fixed point, mount axes
instrument_dy_mm = 246.0
instrument_dz_mm = 31.0
u_instrument_mm = 0.1
u_transport_arcsec = 1.5     # circle against mount, lab to lab
u_collimation_arcsec = 30.0  # both faces are read
u_trunnion_arcsec = 30.0
u_lean_arcsec = 1.0          # of the vertical axis, after levelling
ut1_utc_s = 0.12
u_ut1_utc_s = 0.001
u_clock_s = 0.2
u_pole_arcsec = 0.3          # not looked up

[[reference]]                # the v-block of monument 100 is turned 90 degrees from the line to 102
name = "M102"
v_block_deg = 90.0
u_v_block_arcsec = 2.0

[[point]]
name = "ZY106"
x_mm = -119400.0
y_mm = 12200.0
z_mm = 1900.0
u_x_mm = 0.1
u_y_mm = 0.1
u_z_mm = 0.1

[[point]]
name = "ZY101"
x_mm = 29504.0
y_mm = 115942.0
z_mm = 149.0
u_x_mm = 0.1
u_y_mm = 0.1
u_z_mm = 0.1
""",
        {name: [row[k] for row in rows] for k, name in enumerate(names)},
        instrument="ZY104",
        provenance=WHO,
    )


def plate_levels(rng: np.random.Generator) -> Example:
    alpha2, alpha3, wedge = -14.0 * ARCSECOND, 22.0 * ARCSECOND, (6.0, -9.0)
    mount = gamma(np.pi - np.radians(45.4087), alpha2, alpha3)
    rise = mount @ plumb_from_ground(FRAME, PLACE)[2]
    rows = []
    for plate in (0.0, 180.0):
        for turned in (0.0, 90.0, 180.0, 270.0) * 2:
            o, w = np.radians(turned), np.radians(turned - plate)
            tilt = (rise[0] * np.cos(o) + rise[2] * np.sin(o)) / ARCSECOND
            reading = 4.0 + tilt + wedge[0] * np.cos(w) + wedge[1] * np.sin(w) + 0.8 * rng.standard_normal()
            rows.append((turned, plate, f"{reading:.1f}"))
    return Example(
        "plate-levels",
        'Truth: alpha2 = -14", alpha3 = +22" against the ground frame; level zero 4", wedge of the plate 6" along and\n'
        '-9" across its mark, 0.8" of noise. The plumb line leans 3.9" outwards here and by the deflection.',
        AT
        + DEFLECTION
        + """azimuth_deg = 45.4087
u_scale_percent = 2.0
u_wedge_arcsec = 20.0        # found, as the plate was turned
u_balls_arcsec = 0.5
""",
        {name: [row[k] for row in rows] for k, name in enumerate(("orientation_deg", "plate_deg", "reading_arcsec"))},
        instrument="ZY104",
        provenance=WHO,
    )


def inclinometer(rng: np.random.Generator) -> Example:
    steps = np.array([-600.0, -300.0, 0.0, 300.0, 600.0])
    turned, rows = ARCSECOND * np.array([1400.0, -2300.0]), []
    for case in (0.0, 180.0):
        for p in steps:
            for q in steps:
                warm = 20.0 + 4.0 * rng.standard_normal()
                tilt = (np.array([p + 35.0, q - 20.0]) + 0.3 * rng.standard_normal(2)) * ARCSECOND
                volts = []
                for k in range(2):
                    angle = np.radians(case) + turned[k] - k * np.pi / 2
                    t = tilt[0] * np.cos(angle) - tilt[1] * np.sin(angle)
                    ideal = (0.013, -0.027)[k] + (2e-4, -1e-4)[k] * (warm - 20) + (412.0, 405.0)[k] * (t + 300.0 * t**3)
                    volts.append(f"{ideal + 2e-4 * rng.standard_normal():.5f}")
                rows.append((p, q, case, f"{warm:.1f}", *volts))
    names = ("tilt_x_arcsec", "tilt_y_arcsec", "azimuth_deg", "temperature_c", "x_volt", "y_volt")
    return Example(
        "inclinometer",
        'Truth: zeros 0.013, -0.027 V; scales 412, 405 V/rad; axes turned by 1400", -2300"; bend 300 /rad2 of both;\n'
        'zeros move by 0.2, -0.1 mV/C; the table itself tilts by 35", -20". 0.2 mV of noise, 0.3" in each tilt.',
        """cubic = true
temperature_coefficient = true
table_tilt = true            # the case was turned by 180 degrees
u_tilt_arcsec = 0.3
u_tilt_percent = 0.02
u_volt = 0.0002
""",
        {name: [row[k] for row in rows] for k, name in enumerate(names)},
        instrument="INC-2",
        provenance=WHO,
    )


def hydrostatic_level(rng: np.random.Generator) -> Example:
    heights = {"BM1": 0.0, "ZY103": 8.412, "ZY104": -3.307, "ZY105": 1.951}
    ring, rows = ["BM1", "ZY103", "ZY104", "ZY105", "BM1"], []
    for vessel in (1, 2):
        for a, b in pairwise(ring):
            cold, warm = 11.0 + rng.uniform(-0.5, 0.5), 11.5 + rng.uniform(-0.5, 0.5)
            # 1.2 m of water at 11 C swells by 1.05e-4 of itself for each degree: the warmer drop stands higher.
            swell = 1200.0 * 1.05e-4 * (warm - cold)
            level, zeros = 52.0, (1.3, -0.9) if vessel == 1 else (-0.9, 1.3)
            first = level - heights[a] - zeros[0] + 0.004 * rng.standard_normal()
            last = level + swell - heights[b] - zeros[1] + 0.004 * rng.standard_normal()
            rows.append((a, b, vessel, f"{first:.3f}", f"{last:.3f}", f"{cold:.1f}", f"{warm:.1f}"))
    names = ("from", "to", "vessel_from", "reading_from_mm", "reading_to_mm", "temperature_from_c", "temperature_to_c")
    return Example(
        "hydrostatic-level",
        "Truth: ZY103 +8.412 mm, ZY104 -3.307 mm, ZY105 +1.951 mm over BM1; constant 2.2 mm; 4 um of noise in a\n"
        "reading, temperatures of the drops rounded to 0.1 C.",
        """held = "BM1"
held_height_mm = 0.0
depth_m = 1.2                # of the tube below the water
u_tube_c = 0.05
u_temperature_c = 0.1
u_reading_mm = 0.006
""",
        {name: [row[k] for row in rows] for k, name in enumerate(names)},
        instrument="H5",
        provenance=WHO,
    )


def monument_place(rng: np.random.Generator) -> Example:
    del rng  # an adjustment's answer has no noise of its own to draw
    names = ("ZY103", "ZY104", "ZY105")
    at = np.array([[-12.318, -119.604, 0.0], PLACE, [-117.25, -23.9, 2.9]])
    columns: dict[str, list] = {"point": list(names)}
    columns |= {f"{k}_m": [f"{v:.10f}" for v in at[:, j]] for j, k in enumerate("xyz")}
    cov = {"xx": 0.0121, "xy": 0.0031, "xz": -0.0012, "yy": 0.0169, "yz": 0.0007, "zz": 0.0064}
    columns |= {f"u_{k}_mm": [f"{np.sqrt(cov[2 * k]):.7f}"] * 3 for k in "xyz"}
    columns |= {f"cov_{k}_mm2": [f"{v:.9e}"] * 3 for k, v in cov.items()}
    return Example(
        "monument-place",
        "Truth: the adjusted place stands in the table, a coordinates.csv of `catseye adjust --out`, made up here.",
        """point = "ZY104"
system = "ground"
origin_elevation_m = 806.42
geoid_height_m = -31.0       # chosen
"""
        + DEFLECTION,
        columns,
        instrument="ZY104",
        provenance=WHO,
    )


MAKERS = (monument_azimuth, plate_levels, inclinometer, hydrostatic_level, monument_place)  # each one's place: its seed

if __name__ == "__main__":
    for number, make in enumerate(MAKERS):
        write(make(np.random.default_rng(5200 + number)))
