"""A triplet's calibration as one plain object, SI units, for `catseye triplet --json`."""

from typing import Any

import numpy as np

from catseye.gateways.triplet.symbols import PLACEMENT, PLATE, UNIT, point_places, symbol_values
from catseye.reduction.triplet.result import TOLERANCE, TripletReduction

OWN = ("N_1", "N_2", "N_BC", "margin")  # told under `cycles`


def triplet_object(found: TripletReduction, file: str) -> dict[str, Any]:
    """The calibration; lengths in metres, what is not says its unit. One placement: numbers; several: lists of them.

    found   the calibration of a unit
    file    its sheet's name
    """
    m, plate = found.measurement, found.plate
    return {
        "file": file,
        "triplet": m.triplet,
        "serials": [m.left_prism.serial, m.right_prism.serial],
        "measured_on": m.measured_on.isoformat(),
        "by": m.by,
        "h_corr": found.h_corr,
        "u_h_corr": found.u_h_corr,
        "l_mpbc": found.l_mpbc,
        "u_l_mpbc": found.u_l_mpbc,
        "difference": found.difference,
        "u_difference": found.u_difference,
        "tolerance": TOLERANCE,
        "accepted": found.accepted,
        "conformity_probability": found.conformity_probability,
        "cycles": _one_or_all(_cycles(found)),
        "memo_cycles": _one_or_all(_memo_cycles(found)),
        "chi_square": found.chi_square,
        "degrees_of_freedom": found.degrees_of_freedom,
        "p": found.p,
        "suspects": list(found.suspects),
        "h_corr_without_suspects": found.h_corr_without_suspects,
        "budget": found.budget,
        "agreeing_index_ratio": found.agreeing_ratio,
        "u_agreeing_index_ratio": found.u_agreeing_ratio,
        "air_in_glass": found.air_in_glass,
        "paint": {
            "bounds": plate.paint,
            "from_design": plate.paint_from_design,
            "sampled": plate.sampled,
            "departures": dict(zip(("T_1", "T_2", "BC"), plate.departure, strict=True)),
        },
        "placements": _placements(found),
        "covariance": found.covariance,
        **_symbols(found),
        "points": {name: _one_or_all(list(at)) for name, at in point_places(found).items()},
        "notes": list(found.notes),
    }


def _one_or_all(values: list[Any]) -> Any:
    return values[0] if len(values) == 1 else values


def _cycles(found: TripletReduction) -> list[dict[str, Any]]:
    c = found.cycles
    names = (("N_1", c.n_1), ("N_2", c.n_2), ("N_BC", c.n_bc), ("margin", c.margin))
    return [{name: values[k] for name, values in names} for k in range(len(found.h))]


def _memo_cycles(found: TripletReduction) -> list[dict[str, Any]]:
    """The memo's integers; null where its rule 3.4b is broken."""
    names = (("N_1", found.memo.n_1), ("N_2", found.memo.n_2), ("N_BC", found.memo.n_bc))
    return [
        {name: int(values[k]) if np.isfinite(values[k]) else None for name, values in names}
        for k in range(len(found.h))
    ]


def _symbols(found: TripletReduction) -> dict[str, Any]:
    single = {symbol.name: symbol_values(symbol, found)[0] for symbol in (*UNIT, *PLATE)}
    each = {symbol.name: _one_or_all(symbol_values(symbol, found)) for symbol in PLACEMENT if symbol.name not in OWN}
    return single | each


def _placements(found: TripletReduction) -> list[dict[str, Any]]:
    post = found.readings.l_post - 0.5 * (found.plate.height[0] + found.plate.height[1])
    return [
        {
            "spacer": each.spacer_mm * 1e-3,
            "status": found.status[k],
            "h_corr": found.h[k],
            "u_h_corr": found.u[k],
            "weight": found.weights[k],
            "residual": found.residuals[k],
            "standardised_residual": found.statistics[k],
            "d_toppl_by_ranging": found.lengths.depth_mp[k] - post,
            "step_of_stops": found.steps[k],
            "u_step_of_stops": found.u_steps[k],
            "line_of_sight_to_normal": found.lengths.psi[k],
            "incidence_1": found.lengths.i_1[k],
            "incidence_2": found.lengths.i_2[k],
            "scan_point_along": found.lengths.along[k],
            "scan_point_up": found.lengths.up[k],
        }
        for k, each in enumerate(found.measurement.placement)
    ]
