"""Writes telescope.toml, a structural model of a believable Green Bank Telescope. All of it is chosen, none measured.

    python examples/structural-model/make_example.py

Gravity pulls along (0, cos E, -sin E) in the axes of elevation, reflector and feed arm, so that most terms follow one
of these two; steel grows by 11.7 ppm for each degree C.
"""

from datetime import date
from pathlib import Path

import numpy as np

from catseye.records.site.structural_model import StructuralModel, structural_model_toml

STEEL = 11.7e-6  # for each degree C
TILT_X, TILT_Y = 3.0, -2.2  # arc seconds, of the azimuth axis about east and about north; the size of published AN, AW
AXIS_HEIGHT_MM = 48_260.0
FOOT_MM = np.array([0.0, -8000.0, 10_000.0])  # of the feed arm, reflector frame
PRIME_FOCUS_MM = np.array([0.0, 0.0, 60_000.0])
ARM_TARGETS_MM = {  # reflector frame; the two named targets of the records, the others chosen
    "ZEG41040L": [-2670.0, -4240.0, 57_300.0],
    "ZEG20440L": [-3170.0, -9470.0, 11_850.0],
    "ZEG41040R": [2670.0, -4240.0, 57_300.0],
    "ZEG20440R": [3170.0, -9470.0, 11_850.0],
}
BEARING_TARGETS_MM = {  # alidade frame; ZAG731 from the records, ZAG732 chosen
    "ZAG731P": [-22_320.0, 1340.0, 46_870.0],
    "ZAG731D": [22_360.0, 1240.0, 46_930.0],
    "ZAG732P": [-22_300.0, -1350.0, 46_900.0],
    "ZAG732D": [22_300.0, -1350.0, 46_900.0],
}
TRIPLETS, TRIPLET_RADIUS_MM, APERTURE_Y_MM, FOCAL_LENGTH_MM = 10, 50_350.0, 54_000.0, 60_000.0
SUBREFLECTOR_ELEVATIONS = np.array([0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 95.0])
SUBREFLECTOR_TEMPERATURES = np.array([-25.0, 15.0, 40.0])


def frames() -> list[dict]:
    """The six frames, from the ground up."""
    alidade = {
        "pivot_mm": [0.0, 0.0, 0.0],
        "u_shift_mm": 0.3,
        "u_turn_arcsec": 0.5,
        "terms": ["sinA", "cosA", "t"],
        # an axis leaning always the same way on the ground turns round in the alidade's own axes
        "turn_x_arcsec": [-TILT_Y, TILT_X, 0.0],
        "turn_y_arcsec": [TILT_X, TILT_Y, 0.0],
        "shift_z_mm": [0.0, 0.0, round(STEEL * AXIS_HEIGHT_MM, 4)],
    }
    elevation = {
        "pivot_mm": [0.0, 0.0, 0.0],
        "u_shift_mm": 0.3,
        "u_turn_arcsec": 1.0,
        "terms": ["cosE", "sinE"],
        "shift_y_mm": [1.5, 0.0],
        "shift_z_mm": [0.0, -1.5],
    }
    reflector = {
        "pivot_mm": [0.0, 54_839.108, -4999.99],  # on the elevation axis
        "u_shift_mm": 0.5,
        "u_turn_arcsec": 2.0,
        "terms": ["cosE", "sinE", "sin2E", "t", "cosE*t"],
        "shift_y_mm": [9.0, 0.0, 0.4, 0.0, 0.0],
        "shift_z_mm": [0.0, -7.0, -0.6, 0.06, 0.0],
        "turn_x_arcsec": [-55.0, 18.0, 3.0, 0.0, 0.15],
    }
    feed_arm = {
        "pivot_mm": [0.0, 0.0, 0.0],
        "u_shift_mm": 0.5,
        "u_turn_arcsec": 2.0,
        "terms": ["cosE", "sinE", "sin2E", "t"],
        "shift_y_mm": [5.0, 0.0, 0.3, 0.0],
        "shift_z_mm": [0.0, -3.0, 0.0, round(STEEL * 25_000.0, 4)],
        # 150 arc seconds are 36 mm at the top of the arm, 50 m above its foot
        "turn_x_arcsec": [-150.0, -30.0, 5.0, 0.4],
        "turn_y_arcsec": [0.0, 2.0, 0.0, 0.0],
    }
    e, t = np.radians(SUBREFLECTOR_ELEVATIONS)[:, None], SUBREFLECTOR_TEMPERATURES - 15.0
    subreflector = {
        "pivot_mm": [0.0, 0.0, 0.0],
        "u_shift_mm": 0.2,
        "u_turn_arcsec": 3.0,
        "elevation_deg": SUBREFLECTOR_ELEVATIONS.tolist(),
        "temperature_c": SUBREFLECTOR_TEMPERATURES.tolist(),
        "shift_y_mm": np.round(1.2 * np.cos(e) + 0.0 * t, 3).tolist(),
        "shift_z_mm": np.round(-0.8 * np.sin(e) + STEEL * 8000.0 * t, 3).tolist(),
        "turn_x_arcsec": np.round(-12.0 * np.cos(e) + 0.02 * t * np.sin(e), 2).tolist(),
    }
    return [
        {"name": "alidade", "parent": "ground", "origin_mm": [0.0, 0.0, 0.0], "motion": alidade},
        {"name": "elevation", "parent": "alidade", "origin_mm": [0.0, 0.0, AXIS_HEIGHT_MM], "motion": elevation},
        {
            "name": "reflector",
            "parent": "elevation",
            "origin_mm": [0.0, -54_839.108, 4999.99],
            "motion": reflector,
        },
        {"name": "feed_arm", "parent": "reflector", "origin_mm": FOOT_MM.tolist(), "motion": feed_arm},
        {"name": "prime_focus", "parent": "feed_arm", "origin_mm": (PRIME_FOCUS_MM - FOOT_MM).tolist()},
        {
            "name": "subreflector",
            "parent": "prime_focus",
            "origin_mm": [0.0, -3000.0, 4500.0],
            "motion": subreflector,
        },
    ]


def points(places: dict, *, u: float = 1.0) -> list[dict]:
    return [
        {"name": name, "position_mm": [round(float(v), 3) for v in place], "u_position_mm": u}
        for name, place in places.items()
    ]


def rim() -> dict:
    """Ten triplets round the dish, each sagging by itself: the rim droops where it is far from the elevation axis."""
    found = []
    for k in range(TRIPLETS):
        angle = 2.0 * np.pi * (k + 0.5) / TRIPLETS
        x, y = TRIPLET_RADIUS_MM * np.sin(angle), APERTURE_Y_MM + TRIPLET_RADIUS_MM * np.cos(angle)
        place = {f"TR{k + 1:02d}": [x, y, (x**2 + y**2) / (4.0 * FOCAL_LENGTH_MM) + 250.0]}
        arm = (y - 54_839.0) / 50_000.0
        (point,) = points(place, u=0.5)
        point["shift_y_mm"] = [round(1.1 * abs(x) / 50_000.0, 3), 0.0, 0.0]
        point["shift_z_mm"] = [round(-2.0 * arm, 3), round(-3.0 * arm**2 - 1.5 * (x / 50_000.0) ** 2, 3), 0.02]
        found.append(point)
    shifts = {"terms": ["cosE", "sinE", "t"]}
    return {"name": "rim", "frame": "reflector", "shifts": shifts, "u_shift_mm": 0.3, "point": found}


def model() -> StructuralModel:
    arm = {name: np.array(place) - FOOT_MM for name, place in ARM_TARGETS_MM.items()}
    sub = {
        f"ZES{i + 1}": place
        for i, place in enumerate(([0, 3900, 300], [-3700, -100, 300], [3700, -100, 300], [0, -3900, 300]))
    }
    document = {
        "format": "catseye-structural-model-1",
        "title": "A believable Green Bank Telescope: every number chosen, none measured",
        "serial": "GBT-example",
        "measured_on": date(2004, 4, 29),
        "valid_until": date(2034, 4, 29),
        "by": "catseye",
        "report": "examples/structural-model/make_example.py",
        "elevation_deg": [0.0, 95.0],
        "temperature_c": [-25.0, 40.0],
        "reference_temperature_c": 15.0,
        "frame": frames(),
        "group": [
            {"name": "bearings", "frame": "alidade", "point": points(BEARING_TARGETS_MM)},
            rim(),
            {"name": "arm", "frame": "feed_arm", "point": points(arm)},
            {"name": "subreflector_rim", "frame": "subreflector", "point": points(sub, u=0.5)},
        ],
        "vibration": [
            {
                "name": "sway",
                "frame": "feed_arm",
                "frequency_hz": 0.78,
                "u_frequency_hz": 0.03,
                "damping_ratio": 0.005,
                # seen near the top of the arm, 50 m above the foot: a turn of 4.13 arc seconds for each mm
                "shift_per_x": [0.0, 0.0, 0.0],
                "shift_per_y": [0.0, 0.0, 0.0],
                "turn_arcsec_per_mm_x": [0.0, 4.125, 0.0],
                "turn_arcsec_per_mm_y": [0.0, 0.0, 0.0],
            },
            {
                "name": "nod",
                "frame": "feed_arm",
                "frequency_hz": 1.05,
                "u_frequency_hz": 0.03,
                "damping_ratio": 0.006,
                "shift_per_x": [0.0, 0.0, 0.0],
                "shift_per_y": [0.0, 0.0, 0.0],
                "turn_arcsec_per_mm_x": [0.0, 0.0, 0.0],
                "turn_arcsec_per_mm_y": [-4.125, 0.0, 0.0],
            },
        ],
    }
    return StructuralModel.model_validate(document)


if __name__ == "__main__":
    where = Path(__file__).parent / "telescope.toml"
    where.write_text(structural_model_toml(model()), encoding="utf-8")
