"""Triplets of the simulator as readings and as whole sheets, with noise as the sheets claim it."""

import copy
import tomllib

import numpy as np

from catseye.atmosphere.index.air import group_refractivity
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from catseye.reduction.triplet.geometry import TripletReadings
from catseye.simulator.laboratory.triplet import POST, TripletScenes, TripletSheets, random_scenes, triplet_sheets
from repository import ROOT

SHEET = ROOT / "examples" / "triplets" / "TR99.toml"
N = 1.527077
U = {"phase": 0.0005, "height": 0.003, "l_post": 0.002, "d12": 0.03, "glass": 0.002, "radius": 0.003, "ratio": 1e-5,
     "lateral": 0.05, "temperature": 0.05}  # fmt: skip


def readings_of(scene: TripletScenes, sheet: TripletSheets) -> TripletReadings:
    """The simulator's sheets as the reduction's arrays."""
    names = ("phi_1", "phi_2", "phi_bcfp", "l_1", "l_2", "l_bt", "hrp_1", "hrp_2", "pc_1", "pc_2", "pc_b", "d_toppl",
             "h_s", "d_12")  # fmt: skip
    return TripletReadings(
        **{name: getattr(sheet, name) for name in names},
        phi_zrg=scene.phi_zrg, phi_cal=scene.phi_cal, phi_zrg_fp=scene.phi_zrg_fp, phi_cal_fp=scene.phi_cal,
        eta_a=scene.eta, eta_a_fp=scene.eta_fp, l_post=POST, height_1=scene.height_1, height_2=scene.height_2,
        r_1=scene.radius_1, n=scene.ratio, modulation_hz=scene.frequency,
    )  # fmt: skip


def document() -> dict:
    """The layout's example as TOML gives it, to be changed."""
    return copy.deepcopy(tomllib.loads(SHEET.read_text(encoding="utf-8")))


def measurement(**changes) -> TripletMeasurement:
    """The same as a record; dotted keys as `placement__0__phi_1_rad`."""
    values = document()
    for path, value in changes.items():
        *steps, last = path.split("__")
        table = values
        for step in steps:
            table = table[int(step)] if step.isdigit() else table[step]
        table[last] = value
    return TripletMeasurement.model_validate(values)


def noisy_unit(rng: np.random.Generator, spacers=(0.0, 25.4, 50.8), u=U) -> tuple[TripletMeasurement, float]:
    """A sheet whose every entry is off by its claimed uncertainty, drawn; and the true H_corr in m."""
    count = len(spacers)
    one = random_scenes(rng, 1, offset=0.01)
    true = {name: np.repeat(value, count, axis=0) for name, value in vars(one).items()}
    for name in ("ball_x", "ball_y"):
        true[name] = np.full(count, u["lateral"] * 1e-3 * rng.standard_normal())
    true["ratio"] = np.full(count, N + u["ratio"] * rng.standard_normal())
    true["depth"] = true["depth"] - np.array(spacers) * 1e-3
    true["phi_zrg"], true["phi_zrg_fp"] = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    weather = [20.0 + rng.normal(0.0, 2.0, (2, count)), np.full((2, count), 931.0), np.full((2, count), 47.0)]
    eta, eta_fp = 1.0 + np.asarray(group_refractivity(*weather, model="rueger1990"))
    scene = TripletScenes(**(true | {"eta": eta, "eta_fp": eta_fp}))
    seen = triplet_sheets(scene)

    def off(name: str) -> float:
        return float(u[name] * rng.standard_normal())

    def phase(value: np.ndarray) -> np.ndarray:
        return np.mod(value + u["phase"] * rng.standard_normal(count), 2.0 * np.pi)

    height = [1e3 * float(v[0]) + off("glass") for v in (scene.height_1, scene.height_2)]
    r1, r2 = (1e3 * float(v[0]) + off("radius") for v in (scene.radius_1, scene.radius_2))
    phases = [phase(v) for v in (seen.phi_1, seen.phi_2, seen.phi_bcfp, scene.phi_zrg, scene.phi_zrg_fp)]
    thermometer = weather[0] + u["temperature"] * rng.standard_normal((2, count))
    values = document() | {
        "d12_mm": 1e3 * float(seen.d_12[0]) + off("d12"), "u_d12_mm": u["d12"],
        "u_bk7_to_air_group_index_ratio": u["ratio"], "u_lateral_mm": u["lateral"],
        "u_temperature_c": u["temperature"], "u_pressure_hpa": 0.0, "u_humidity_percent": 0.0,
        "surface_plate": {
            "l1_mm": 1e3 * float(seen.l_1[0]) + off("height"), "l2_mm": 1e3 * float(seen.l_2[0]) + off("height"),
            "l_bt_mm": 1e3 * float(seen.l_bt[0]) + off("height"), "l_post_mm": 88.9 + off("l_post"),
            "u_height_mm": u["height"], "u_l_post_mm": u["l_post"],
        },
        "ball": {"r1_mm": r1, "r2_mm": r2, "u_r_mm": u["radius"], "pc_b_mm": r1 - N * (r1 + r2)},
    }  # fmt: skip
    for side, serial, h in (("left", 1, height[0]), ("right", 2, height[1])):
        values[f"{side}_prism"] = {
            "serial": serial, "height_mm": h, "u_height_mm": u["glass"], "hrp_mm": h / N, "pc_mm": -(N - 1.0 / N) * h,
        }  # fmt: skip
    values["placement"] = [
        {
            "spacer_mm": float(spacers[k]), "d_toppl_mm": 1e3 * float(seen.d_toppl[k]),
            "h_s_mm": 1e3 * float(seen.h_s[k]),
            "phi_1_rad": float(phases[0][k]), "phi_2_rad": float(phases[1][k]), "phi_bcfp_rad": float(phases[2][k]),
            "phi_zrg_rad": float(phases[3][k]), "phi_zrg_flipped_rad": float(phases[4][k]),
            "phi_cal_rad": float(scene.phi_cal[k]), "u_phase_rad": u["phase"],
            "temperature_c": float(thermometer[0, k]), "temperature_flipped_c": float(thermometer[1, k]),
            "pressure_hpa": 931.0, "humidity_percent": 47.0,
        }
        for k in range(count)
    ]  # fmt: skip
    return TripletMeasurement.model_validate(values), float(scene.h_corr[0])
