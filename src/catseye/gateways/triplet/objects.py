"""Calibration of a triplet as an object for `catseye triplet --json`, SI units."""

from typing import Any

import numpy as np

from catseye.gateways.triplet.symbols import PLACEMENT, PLATE, UNIT, point_places, symbol_values
from catseye.reduction.triplet.result import TOLERANCE, TripletReduction

CYCLES = ("N_1", "N_2", "N_BC", "margin")  # listed under `cycles`


def triplet_object(reduction: TripletReduction, file: str) -> dict[str, Any]:
    """Object of the calibration; lengths in metres, other units in the keys.

    With one placement values are numbers, with several lists.

    reduction   the calibration of a unit
    file        name of its sheet
    """
    m, plate = reduction.measurement, reduction.plate
    return {
        "verdict": reduction.verdict.to_object(),
        "file": file,
        "triplet": m.triplet,
        "serials": [m.left_prism.serial, m.right_prism.serial],
        "measured_on": m.measured_on.isoformat(),
        "by": m.by,
        "h_corr": reduction.h_corr,
        "u_h_corr": reduction.u_h_corr,
        "l_mpbc": reduction.l_mpbc,
        "u_l_mpbc": reduction.u_l_mpbc,
        "difference": reduction.difference,
        "u_difference": reduction.u_difference,
        "tolerance": TOLERANCE,
        "accepted": reduction.accepted,
        "conformity_probability": reduction.conformity_probability,
        "cycles": _one_or_all(_cycles(reduction)),
        "memo_cycles": _one_or_all(_memo_cycles(reduction)),
        "chi_square": reduction.chi_square,
        "degrees_of_freedom": reduction.degrees_of_freedom,
        "p": reduction.p,
        "suspects": list(reduction.suspects),
        "h_corr_without_suspects": reduction.h_corr_without_suspects,
        "budget": reduction.budget,
        "agreeing_index_ratio": reduction.agreeing_ratio,
        "u_agreeing_index_ratio": reduction.u_agreeing_ratio,
        "air_in_glass": reduction.air_in_glass,
        "paint": {
            "bounds": plate.paint,
            "from_design": plate.paint_from_design,
            "sampled": plate.sampled,
            "departures": dict(zip(("T_1", "T_2", "BC"), plate.departure, strict=True)),
        },
        "placements": _placements(reduction),
        "covariance": reduction.covariance,
        **_symbols(reduction),
        "points": {name: _one_or_all(list(at)) for name, at in point_places(reduction).items()},
        "notes": list(reduction.notes),
    }


def _one_or_all(values: list[Any]) -> Any:
    return values[0] if len(values) == 1 else values


def _cycles(reduction: TripletReduction) -> list[dict[str, Any]]:
    c = reduction.cycles
    names = (("N_1", c.n_1), ("N_2", c.n_2), ("N_BC", c.n_bc), ("margin", c.margin))
    return [{name: values[k] for name, values in names} for k in range(len(reduction.h))]


def _memo_cycles(reduction: TripletReduction) -> list[dict[str, Any]]:
    """Integers of the memo; null where its rule 3.4b is violated."""
    names = (("N_1", reduction.memo.n_1), ("N_2", reduction.memo.n_2), ("N_BC", reduction.memo.n_bc))
    return [
        {name: int(values[k]) if np.isfinite(values[k]) else None for name, values in names}
        for k in range(len(reduction.h))
    ]


def _symbols(reduction: TripletReduction) -> dict[str, Any]:
    single = {symbol.name: symbol_values(symbol, reduction)[0] for symbol in (*UNIT, *PLATE)}
    per_placement = {
        symbol.name: _one_or_all(symbol_values(symbol, reduction)) for symbol in PLACEMENT if symbol.name not in CYCLES
    }
    return single | per_placement


def _placements(reduction: TripletReduction) -> list[dict[str, Any]]:
    post = reduction.readings.l_post - 0.5 * (reduction.plate.height[0] + reduction.plate.height[1])
    return [
        {
            "spacer": placement.spacer_mm * 1e-3,
            "status": reduction.status[k],
            "h_corr": reduction.h[k],
            "u_h_corr": reduction.u[k],
            "weight": reduction.weights[k],
            "residual": reduction.residuals[k],
            "standardised_residual": reduction.statistics[k],
            "d_toppl_by_ranging": reduction.lengths.depth_mp[k] - post,
            "step_of_stops": reduction.steps[k],
            "u_step_of_stops": reduction.u_steps[k],
            "line_of_sight_to_normal": reduction.lengths.psi[k],
            "incidence_1": reduction.lengths.i_1[k],
            "incidence_2": reduction.lengths.i_2[k],
            "scan_point_along": reduction.lengths.along[k],
            "scan_point_up": reduction.lengths.up[k],
        }
        for k, placement in enumerate(reduction.measurement.placement)
    ]
