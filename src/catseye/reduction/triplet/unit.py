"""Calibration of a triplet unit: H_corr with uncertainty, and acceptance.

Source: [GOLDMAN00] sections 1.2 and 1.3, eq. D.1 for the ratio of the indices.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.atmosphere.index.air import group_refractivity
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from catseye.reduction.triplet.geometry import (
    TripletCycles,
    TripletLengths,
    TripletReadings,
    triplet_cycles,
    triplet_lengths,
)
from catseye.reduction.triplet.memo import memo_numbers
from catseye.reduction.triplet.notes import triplet_notes
from catseye.reduction.triplet.plate import plate_points
from catseye.reduction.triplet.result import TOLERANCE, TripletReduction, conformity_probability
from catseye.reduction.triplet.uncertainty import TripletShares, triplet_shares

LEVEL = 0.05  # of the tests of consistency and of single placements together
SIGMAS = 5.0  # of D_TOPPL that the margin of the whole cycles must hold
FAR = 10e-3  # m: ranging and plate differ by more than any triplet's parts, a tenth of a slip
REFERENCE_AIR = (20.0, 933.0, 50.0)  # deg C, hPa, %: of the memo's index ratio 1.527077
FLOOR = 1e-9  # m, added to each placement: below the phases' last digit; keeps repeated ones non-singular
GOOD, THIN, SUSPECT, NOT_A_TRIANGLE, SLIPPED = (
    "good", "thin margin", "suspect", "no triangle: left out", "whole cycles doubtful",
)  # fmt: skip


def reduce_triplet(measurement: TripletMeasurement) -> TripletReduction:
    """Reduction of one sheet.

    measurement   a measured unit

    A placement whose ranges make no triangle is left out with its status; without any other the answer is NaN and the
    unit is not accepted. Nothing else is left out.

    Source: [GOLDMAN00] sections 3.1 and 3.2; combination of placements by generalised least squares.
    """
    readings = triplet_readings(measurement)
    cycles = triplet_cycles(readings)
    lengths = triplet_lengths(readings, cycles)
    shares = triplet_shares(measurement, readings, cycles)
    covariance = shares.h_corr.T @ shares.h_corr
    used = np.flatnonzero(np.isfinite(np.diagonal(covariance)) & np.isfinite(lengths.h_corr))
    best = combined(lengths.h_corr, covariance, used)
    l_mpbc = float(np.ravel(lengths.l_mpbc)[0])
    # shares of each input in the best h_corr: rejected placements have weight 0, whatever their NaN
    share = shares.h_corr[:, used] @ best.weights[used]
    valid = len(used) > 0
    u_h = float(np.linalg.norm(share)) if valid else math.nan
    difference = best.value - l_mpbc
    u_difference = float(np.linalg.norm(share - shares.l_mpbc)) if valid else math.nan
    consistent = np.setdiff1d(used, best.suspects)
    agreeing_ratio, u_agreeing_ratio = _agreeing_ratio(measurement, shares, difference, share)
    steps, u_steps = _steps(measurement, lengths, shares)
    status = tuple(_status(measurement, k, lengths, cycles, best.suspects) for k in range(len(measurement.placement)))
    memo = memo_numbers(readings, cycles, lengths)
    reduction = TripletReduction(
        measurement=measurement,
        readings=readings,
        cycles=cycles,
        lengths=lengths,
        memo=memo,
        plate=plate_points(measurement),
        h=lengths.h_corr,
        u=np.sqrt(np.diagonal(covariance)),
        covariance=covariance,
        weights=best.weights,
        h_corr=best.value,
        u_h_corr=u_h,
        l_mpbc=l_mpbc,
        u_l_mpbc=float(np.linalg.norm(shares.l_mpbc)),
        difference=difference,
        u_difference=u_difference,
        accepted=bool(abs(difference) <= TOLERANCE),
        conformity_probability=conformity_probability(difference, u_difference),
        residuals=best.residuals,
        statistics=best.statistics,
        chi_square=best.chi_square,
        degrees_of_freedom=best.degrees_of_freedom,
        p=best.p,
        suspects=best.suspects,
        h_corr_without_suspects=(
            combined(lengths.h_corr, covariance, consistent).value if best.suspects and len(consistent) else math.nan
        ),
        budget=_budget(shares, share) if valid else {},
        l_mpbc_budget=_budget(shares, shares.l_mpbc),
        difference_budget=_budget(shares, share - shares.l_mpbc) if valid else {},
        steps=steps,
        u_steps=u_steps,
        air_in_glass=_air_in_glass(measurement, readings, best.weights),
        agreeing_ratio=agreeing_ratio,
        u_agreeing_ratio=u_agreeing_ratio if valid else math.nan,
        status=status,
        notes=(),
    )
    return replace(reduction, notes=tuple(triplet_notes(reduction)))


def triplet_readings(measurement: TripletMeasurement) -> TripletReadings:
    """Sheet as arrays over its placements, metres.

    The air's index by the sheet's model.

    measurement   a measured unit

    Where the sheet has the group index of the glass, the delay in it follows the air of each placement, the fiducial
    points staying at the sheet's places.
    """
    m, plate = measurement, measurement.surface_plate
    left_prism, right_prism = m.prisms

    def column(name: str) -> Array:
        return np.array([getattr(placement, name) for placement in m.placement], dtype=float)

    def metres(length_mm: float) -> Array:
        return np.asarray(length_mm * 1e-3)

    def after(quantity: str, unit: str) -> Array:
        return np.array([placement.flipped(quantity, unit) for placement in m.placement], dtype=float)

    light = {"wavelength_um": m.wavelength_um, "model": m.air_model}
    weather = column("temperature_c"), column("pressure_hpa"), column("humidity_percent")
    eta = 1.0 + group_refractivity(*weather, **light)
    eta_fp = 1.0 + group_refractivity(
        after("temperature", "c"), after("pressure", "hpa"), after("humidity", "percent"), **light
    )
    n = m.bk7_to_air_group_index_ratio
    extra = np.zeros_like(eta) if m.bk7_group_index is None else m.bk7_group_index / eta - n
    extra_fp = np.zeros_like(eta) if m.bk7_group_index is None else m.bk7_group_index / eta_fp - n
    return TripletReadings(
        phi_1=column("phi_1_rad"),
        phi_2=column("phi_2_rad"),
        phi_zrg=column("phi_zrg_rad"),
        phi_cal=column("phi_cal_rad"),
        phi_bcfp=column("phi_bcfp_rad"),
        phi_zrg_fp=after("phi_zrg", "rad"),
        phi_cal_fp=after("phi_cal", "rad"),
        eta_a=eta,
        eta_a_fp=eta_fp,
        d_toppl=column("d_toppl_mm") * 1e-3,
        h_s=column("h_s_mm") * 1e-3,
        d_12=metres(m.d12_mm),
        l_1=metres(plate.l1_mm),
        l_2=metres(plate.l2_mm),
        l_bt=metres(plate.l_bt_mm),
        l_post=metres(plate.l_post_mm),
        height_1=metres(left_prism.height_mm),
        height_2=metres(right_prism.height_mm),
        hrp_1=metres(left_prism.hrp_mm),
        hrp_2=metres(right_prism.hrp_mm),
        pc_1=(left_prism.pc_mm - left_prism.height_mm * extra) * 1e-3,
        pc_2=(right_prism.pc_mm - right_prism.height_mm * extra) * 1e-3,
        pc_b=(m.ball.pc_b_mm - (m.ball.r1_mm + m.ball.r2_mm) * extra_fp) * 1e-3,
        r_1=metres(m.ball.r1_mm),
        n=np.asarray(n),
        modulation_hz=np.asarray(m.modulation_hz),
    )


@dataclass(frozen=True, eq=False)
class Combined:
    """Combination of correlated values of one quantity.

    See `TripletReduction` for the terms.
    """

    value: float
    weights: Array
    residuals: Array
    statistics: Array
    chi_square: float
    degrees_of_freedom: int
    p: float
    suspects: tuple[int, ...]


def combined(values: Array, covariance: Array, used: NDArray[np.intp]) -> Combined:
    """Least-variance mean of correlated values, with suspects.

    values       (k,)
    covariance   (k, k), of the used ones above zero
    used         True where a value counts

    The suspects are found one by one, the largest standardised residual w first, each judged without those before it,
    by the two-sided limit of the level 5 % shared among all. Of two values that contradict each other both are
    suspects.

    Source: generalised least squares with Baarda's w, written out for one unknown.

    >>> best = combined(np.array([1.0, 2.0]), np.diag([1.0, 4.0]), np.arange(2))
    >>> round(best.value, 3), best.degrees_of_freedom, round(best.chi_square, 3)
    (1.2, 1, 0.2)
    """
    from scipy.special import chdtrc, ndtri  # heavy

    weights, residuals, statistics = np.zeros(len(values)), *(np.full(len(values), np.nan) for _ in range(2))
    if not len(used):
        return Combined(
            value=math.nan,
            weights=weights,
            residuals=residuals,
            statistics=statistics,
            chi_square=math.nan,
            degrees_of_freedom=0,
            p=math.nan,
            suspects=(),
        )
    weights[used], inverse = _weights(covariance, used)
    value = float(weights[used] @ values[used])
    deviation = values[used] - value
    residuals[used] = deviation
    degrees = len(used) - 1
    if not degrees:
        return Combined(
            value=value,
            weights=weights,
            residuals=residuals,
            statistics=statistics,
            chi_square=0.0,
            degrees_of_freedom=0,
            p=math.nan,
            suspects=(),
        )
    chi_square = float(deviation @ inverse @ deviation)
    statistics[used] = _standardised(values, covariance, used)
    limit = -float(ndtri(0.5 * LEVEL / len(used)))
    suspects: list[int] = []
    unsuspected, w = used, statistics[used]
    while len(unsuspected) > 1 and np.max(np.abs(w)) > limit:
        if len(unsuspected) == 2:  # undecided which
            suspects += [int(k) for k in unsuspected]
            break
        worst = int(np.argmax(np.abs(w)))
        suspects.append(int(unsuspected[worst]))
        unsuspected = np.delete(unsuspected, worst)
        w = _standardised(values, covariance, unsuspected)
    p = float(chdtrc(degrees, chi_square))
    return Combined(
        value=value,
        weights=weights,
        residuals=residuals,
        statistics=statistics,
        chi_square=chi_square,
        degrees_of_freedom=degrees,
        p=p,
        suspects=tuple(sorted(suspects)),
    )


def _weights(covariance: Array, used: NDArray[np.intp]) -> tuple[Array, Array]:
    """Weights of least variance, and the inverse of the covariance."""
    apart = covariance[np.ix_(used, used)] + np.eye(len(used)) * FLOOR**2  # placements with identical errors
    inverse = np.asarray(np.linalg.inv(apart), dtype=np.float64)
    return inverse.sum(axis=1) / inverse.sum(), inverse


def _standardised(values: Array, covariance: Array, used: NDArray[np.intp]) -> Array:
    """Test statistic w of each value.

    With v the residuals the covariance of C^-1 v is C^-1 - C^-1 1 1' C^-1 / (1' C^-1 1).
    """
    weights, inverse = _weights(covariance, used)
    residuals = values[used] - weights @ values[used]
    spread = inverse - np.outer(inverse.sum(axis=1), inverse.sum(axis=0)) / inverse.sum()
    return (inverse @ residuals) / np.sqrt(np.diagonal(spread))


def _budget(shares: TripletShares, share: Array) -> dict[str, float]:
    """Contribution of each group to an uncertainty, m, from those of its inputs (q,)."""
    budget: dict[str, float] = {}
    for group, value in zip(shares.groups, share, strict=True):
        budget[group] = math.hypot(budget.get(group, 0.0), float(value))
    return budget


def _agreeing_ratio(
    m: TripletMeasurement, shares: TripletShares, difference: float, share: Array
) -> tuple[float, float]:
    """Index ratio that reconciles ranging and surface plate, and its u.

    difference   m, H_corr by ranging less that by the surface plate
    share        (q,) m, of each input in H_corr by ranging
    """
    slope = 0.5 * sum(p.height_mm for p in m.prisms) - m.ball.r1_mm - m.ball.r2_mm
    by_sizes = np.array([group != "index ratio" for group in shares.groups])
    u = float(np.linalg.norm((share - shares.l_mpbc)[by_sizes])) / abs(slope * 1e-3)
    return m.bk7_to_air_group_index_ratio - difference / (slope * 1e-3), u


def _steps(m: TripletMeasurement, lengths: TripletLengths, shares: TripletShares) -> tuple[Array, Array]:
    """Place of the stops by ranging relative to the first placement, and its u."""
    spacer = np.array([placement.spacer_mm for placement in m.placement]) * 1e-3
    place = lengths.depth_mp + spacer
    u_spacer = np.where(spacer != spacer[0], math.sqrt(2.0) * m.u_spacer_mm * 1e-3, 0.0)
    return place - place[0], np.hypot(np.linalg.norm(shares.depth - shares.depth[:, :1], axis=0), u_spacer)


def _air_in_glass(m: TripletMeasurement, r: TripletReadings, weights: Array) -> float:
    """Change of h_corr by a glass index that does not follow the air's."""
    if m.bk7_group_index is not None:
        return 0.0
    reference = 1.0 + float(group_refractivity(*REFERENCE_AIR, wavelength_um=m.wavelength_um, model=m.air_model))
    n = m.bk7_to_air_group_index_ratio
    prisms = 0.5e-3 * sum(p.height_mm for p in m.prisms) * (reference / r.eta_a - 1.0)
    ball = 1e-3 * (m.ball.r1_mm + m.ball.r2_mm) * (reference / r.eta_a_fp - 1.0)
    return float(weights @ (n * (prisms - ball)))


def _status(
    m: TripletMeasurement, k: int, lengths: TripletLengths, cycles: TripletCycles, suspects: tuple[int, ...]
) -> str:
    h = float(lengths.h_corr[k])
    if not math.isfinite(h):
        return NOT_A_TRIANGLE
    if abs(h - float(np.ravel(lengths.l_mpbc)[0])) > FAR:
        return SLIPPED
    if float(cycles.margin[k]) < SIGMAS * m.u_d_toppl_mm * 1e-3:
        return THIN
    return SUSPECT if k in suspects else GOOD
