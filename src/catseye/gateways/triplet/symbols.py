"""Symbols of the triplet memo's section 3.4, with meanings and values in a calibration.

`prism_D_1` and `prism_D_2` are the memo's bold D, the prisms' heights; `I_1` its gothic I; `dPc_1` its delta Pc. Psi,
D_0 and I follow the memo's formulas; H_corr is based on the ranges (see `reduction.triplet.geometry`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from catseye.constants import SPEED_OF_LIGHT
from catseye.reduction.triplet.geometry import half_wavelengths
from catseye.reduction.triplet.result import TripletReduction

Value = Callable[[TripletReduction], Any]


@dataclass(frozen=True)
class Symbol:
    """Symbol of the memo.

    name      as in the JSON
    label     as printed
    meaning   in words, with the memo's formula if any
    unit      of the printed sheet: mm, rad, °C, hPa, % or none; the JSON has metres
    value     function from a calibration to one number, or one per placement, SI
    design    the memo's design value, as printed
    """

    name: str
    label: str
    meaning: str
    unit: str
    value: Value
    design: str = ""


def _reading(name: str) -> Value:
    return lambda reduction: getattr(reduction.readings, name)


def _length(name: str) -> Value:
    return lambda reduction: getattr(reduction.lengths, name)


def _memo(name: str) -> Value:
    return lambda reduction: getattr(reduction.memo, name)


def _cycles(name: str) -> Value:
    return lambda reduction: getattr(reduction.cycles, name)


def _height(number: int) -> Value:
    return lambda reduction: reduction.plate.height[number]


def _middle(reduction: TripletReduction) -> float:
    return 0.5 * (reduction.plate.height[0] + reduction.plate.height[1])


def _half(after: bool) -> Value:
    return lambda reduction: half_wavelengths(reduction.readings)[after]


def _whole_cycles_length(name: str, after: bool = False) -> Value:
    return lambda reduction: getattr(reduction.cycles, name) * half_wavelengths(reduction.readings)[after]


def _less_delta(name: str) -> Value:
    return lambda reduction: getattr(reduction.lengths, name) - _whole_cycles_length("n_1")(reduction)


def _weather(quantity: str, unit: str, after: bool = False) -> Value:
    if after:
        return lambda reduction: np.array([p.flipped(quantity, unit) for p in reduction.measurement.placement])
    return lambda reduction: np.array([getattr(p, f"{quantity}_{unit}") for p in reduction.measurement.placement])


UNIT = (
    Symbol("prism_D_1", "D₁ (prism)", "height of the left prism, corner to pole point", "mm", _reading("height_1"),
           "≈ 38.4"),
    Symbol("prism_D_2", "D₂ (prism)", "height of the right prism", "mm", _reading("height_2"), "≈ 38.4"),
    Symbol("R_1", "R₁", "radius of the small ball of the cat's-eye", "mm", _reading("r_1"), "1.969 in"),
    Symbol("R_2", "R₂", "radius of its large ball-cap", "mm", lambda f: f.measurement.ball.r2_mm * 1e-3, "3.799 in"),
    Symbol("D_12", "D₁₂", "distance from T₁ to T₂", "mm", _reading("d_12"), "635.00"),
    Symbol("Pc_B", "Pc_B", "range constant of the ball's glass", "mm", lambda f: f.measurement.ball.pc_b_mm * 1e-3,
           "≈ -173.6"),  # as printed; its radii and index give -173.7
    Symbol("Pc_T1", "Pc(T₁)", "range constant of the left prism, normal incidence", "mm",
           lambda f: f.measurement.left_prism.pc_mm * 1e-3, "≈ -33.5"),
    Symbol("Pc_T2", "Pc(T₂)", "range constant of the right prism, normal incidence", "mm",
           lambda f: f.measurement.right_prism.pc_mm * 1e-3, "≈ -33.5"),
    Symbol("Hrp_T1", "H_rp(T₁)", "T₁ from its pole point PP₁, D₁ / n", "mm", _reading("hrp_1"), "≈ 25.2"),
    Symbol("Hrp_T2", "H_rp(T₂)", "T₂ from its pole point PP₂, D₂ / n", "mm", _reading("hrp_2"), "≈ 25.2"),
    Symbol("n", "n", "group index of the glass over that of the air", "", _reading("n"), "1.527077"),
)  # fmt: skip

PLATE = (
    Symbol("L_1", "L₁", "pole point PP₁ above the surface plate, prisms up", "mm", _reading("l_1")),
    Symbol("L_2", "L₂", "pole point PP₂ above the surface plate", "mm", _reading("l_2")),
    Symbol("L_BT", "L_BT", "vertex of the small ball above the surface plate", "mm", _reading("l_bt")),
    Symbol("L_T1", "L(T₁)", "T₁ above the surface plate, L₁ - H_rp(T₁)", "mm", _height(0)),
    Symbol("L_T2", "L(T₂)", "T₂ above the surface plate, L₂ - H_rp(T₂)", "mm", _height(1)),
    Symbol("L_MP", "L_MP", "mid-point of T₁ and T₂ above the surface plate", "mm", _middle),
    Symbol("L_BC", "L_BC", "ball's centre above the surface plate, L_BT + R₁", "mm", _height(2)),
    Symbol("L_MPBC", "L_MPBC", "ball's centre above the mid-point, L_BC - L_MP", "mm", lambda f: f.l_mpbc, "≈ 0.0"),
    Symbol("L_post", "L_post", "half-length of the fixture: synthetic plane above the plate", "mm",
           _reading("l_post"), "88.900"),
    Symbol("delta_dsp", "δ_dsp", "2 L_post - 2 L_MP - L_MPBC: δ_range predicted by the plate", "mm",
           lambda f: 2.0 * f.readings.l_post - 2.0 * _middle(f) - f.l_mpbc),
    Symbol("HWLV", "HWLV", "half wavelength of the modulation in vacuum, c / 2f", "mm",
           lambda f: 0.5 * SPEED_OF_LIGHT / f.measurement.modulation_hz, "99.930819"),
)  # fmt: skip

PLACEMENT = (
    Symbol("D_TOPPL", "D_TOPPL", "scan point to the top plate, perpendicular, as measured", "mm", _reading("d_toppl")),
    Symbol("h_S", "h_S", "scan point above the line T₁-T₂", "mm", _reading("h_s")),
    Symbol("T_c", "T", "air temperature, prisms towards the ranger", "°C", _weather("temperature", "c"), "20"),
    Symbol("P_hpa", "P", "air pressure", "hPa", _weather("pressure", "hpa"), "933"),
    Symbol("h_percent", "%h", "relative humidity", "%", _weather("humidity", "percent"), "50"),
    Symbol("eta_A", "η_A", "group index of the air", "", _reading("eta_a"), "1.00025324"),
    Symbol("eta_G", "η_G", "group index of the glass, n η_A", "",
           lambda f: f.readings.n * f.readings.eta_a
           if f.measurement.bk7_group_index is None else f.measurement.bk7_group_index, "1.527463"),
    Symbol("HWLA", "HWLA", "half wavelength in the air, HWLV / η_A", "mm", _half(False)),
    Symbol("T_fp_c", "T fp", "air temperature after the flip", "°C", _weather("temperature", "c", True)),
    Symbol("P_fp_hpa", "P fp", "air pressure after the flip", "hPa", _weather("pressure", "hpa", True)),
    Symbol("h_fp_percent", "%h fp", "relative humidity after the flip", "%", _weather("humidity", "percent", True)),
    Symbol("eta_A_fp", "η_A fp", "group index of the air after the flip", "", _reading("eta_a_fp")),
    Symbol("HWLA_fp", "HWLA fp", "half wavelength in the air after the flip", "mm", _half(True)),
    Symbol("Phi_1", "Φ₁", "phase, left prism", "rad", _reading("phi_1")),
    Symbol("Phi_2", "Φ₂", "phase, right prism", "rad", _reading("phi_2")),
    Symbol("Phi_ZRG", "Φ_ZRG", "phase, ranger's reference prism", "rad", _reading("phi_zrg")),
    Symbol("Phi_Cal", "Φ_Cal", "phase of zero distance", "rad", _reading("phi_cal")),
    Symbol("Phi_BCfp", "Φ_BCfp", "phase, ball, after the flip", "rad", _reading("phi_bcfp")),
    Symbol("Phi_ZRG_fp", "Φ_ZRG fp", "phase, reference prism, after the flip", "rad", _reading("phi_zrg_fp")),
    Symbol("Phi_Cal_fp", "Φ_Cal fp", "phase of zero distance, after the flip", "rad", _reading("phi_cal_fp")),
    Symbol("N_1", "N₁", "whole half wavelengths, scan point to T₁", "", _cycles("n_1"), "182"),
    Symbol("N_2", "N₂", "whole half wavelengths, scan point to T₂", "", _cycles("n_2"), "182"),
    Symbol("N_BC", "N_BC", "whole half wavelengths, scan point to BC, after the flip", "", _cycles("n_bc"), "184"),
    Symbol("margin", "margin", "additional error of D_TOPPL before one of these changes", "mm",
           _cycles("margin")),
    Symbol("Delta_1", "Δ₁", "HWLA N₁", "mm", _whole_cycles_length("n_1")),
    Symbol("Delta_2", "Δ₂", "HWLA N₂", "mm", _whole_cycles_length("n_2")),
    Symbol("Delta_BC", "Δ_BC", "HWLA fp N_BC", "mm", _whole_cycles_length("n_bc", True)),
    Symbol("Delta", "Δ", "HWLA N₁", "mm", _whole_cycles_length("n_1")),
    Symbol("D_1", "D₁", "distance from S to T₁", "mm", _length("d_1")),
    Symbol("D_2", "D₂", "distance from S to T₂", "mm", _length("d_2")),
    Symbol("D_BCfp", "D_BCfp", "distance from S to the ball's centre, after the flip", "mm", _length("d_bcfp")),
    Symbol("D_MP", "D_MP", "distance from S to the mid-point, exact median (3.17)", "mm", _length("d_mp")),
    Symbol("D_0", "D₀", "√(h_S² + D_TOPPL²): S to the line T₁-T₂", "mm", _memo("d_0")),
    Symbol("delta_1", "δ₁", "D₁ - Δ", "mm", _less_delta("d_1")),
    Symbol("delta_2", "δ₂", "D₂ - Δ", "mm", _less_delta("d_2")),
    Symbol("delta_MP", "δ_MP", "D_MP - Δ", "mm", _less_delta("d_mp")),
    Symbol("delta_BCfp", "δ_BCfp", "D_BCfp - Δ", "mm", _less_delta("d_bcfp")),
    Symbol("alpha", "α", "0.5 + (D₁² - D₂²) / 2 D₁₂²: foot of the perpendicular from S", "", _length("alpha")),
    Symbol("I_1", "ℑ₁", "arccos(D₀ / D₁): incidence, left prism", "rad", _memo("i_1")),
    Symbol("I_2", "ℑ₂", "arccos(D₀ / D₂): incidence, right prism", "rad", _memo("i_2")),
    Symbol("dPc_1", "δPc(ℑ₁)", "change of the left prism's constant with incidence (B.1)", "mm", _length("dpc_1"),
           "small"),
    Symbol("dPc_2", "δPc(ℑ₂)", "change of the right prism's constant with incidence", "mm", _length("dpc_2"), "small"),
    Symbol("Psi", "Ψ", "arcsin((0.5 - α) D₁₂ / D₀): S-MP against the normal", "rad", _memo("psi")),
    Symbol("delta_range", "δ_range", "depth of MP minus depth of BC fp along the normal, by ranging", "mm",
           _length("delta_range")),
    Symbol("H_corr", "H_corr", "2 L_post - 2 L_MP - δ_range: distance from MP to BC", "mm", _length("h_corr")),
    Symbol("memo_D_MP", "D_MP memo", "the memo's series (3.19b), not used", "mm", _memo("d_mp")),
    Symbol("memo_H_corr", "H_corr memo", "by 3.19b and 3.28, with the whole cycles above; not used", "mm",
           _memo("h_corr")),
    Symbol("memo_H_corr_by_INT", "H_corr INT", "the same with the memo's INT rule; not used", "mm",
           _memo("h_corr_by_int")),
)  # fmt: skip

POINTS = {
    "S": "scan point of the ranger, the origin",
    "T_1": "fiducial reference point of the left prism",
    "T_2": "fiducial reference point of the right prism",
    "MP": "mid-point of T_1 and T_2",
    "PP_1": "pole point of the left prism: foot of the perpendicular from its corner on its face",
    "PP_2": "pole point of the right prism",
    "BC": "centre of the small ball, prisms towards the ranger",
    "MP_fp": "mid-point after the flip (subscript fp: ball towards the ranger)",
    "BC_fp": "centre of the small ball after the flip",
}


def symbol_values(symbol: Symbol, reduction: TripletReduction) -> list[Any]:
    """One value, or one per placement, SI."""
    return [item.item() if isinstance(item, np.generic) else item for item in np.ravel(symbol.value(reduction))]


def point_places(reduction: TripletReduction) -> dict[str, np.ndarray]:
    """Positions of the points per placement, (k, 3) m from S, (1, 3): along the prisms, up, to the ranger."""
    x, r = reduction.lengths, reduction.readings
    rise = r.l_2 - r.hrp_2 - r.l_1 + r.hrp_1
    step = np.array([0.5 * np.sqrt(r.d_12**2 - rise**2), 0.0, 0.5 * rise])
    middle = -np.stack([x.along, x.up, x.depth_mp], axis=-1)
    normal = np.array([0.0, 0.0, 1.0])
    ball_fp = -np.stack([x.along, x.up, x.depth_bcfp], axis=-1)
    return {
        "S": np.zeros((1, 3)),
        "T_1": middle - step,
        "T_2": middle + step,
        "MP": middle,
        "PP_1": middle - step + r.hrp_1 * normal,
        "PP_2": middle + step + r.hrp_2 * normal,
        "BC": middle + x.h_corr[:, None] * normal,
        "MP_fp": ball_fp + x.h_corr[:, None] * normal,
        "BC_fp": ball_fp,
    }
