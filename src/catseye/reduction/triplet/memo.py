"""Numbers by the triplet memo's own formulas, for comparison only.

They differ where its formulas are approximate: INT and the phase's sign for whole cycles (3.13, 3.16), the series for
the median (3.19b), D_0 from D_TOPPL (3.20) instead of from the ranges.
"""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.reduction.triplet.geometry import TripletCycles, TripletLengths, TripletReadings, half_wavelengths
from catseye.signal.cycles.whole import memo_whole_cycles


@dataclass(frozen=True, eq=False)
class MemoNumbers:
    """Results of the memo's formulas, one per placement; NaN where invalid.

    n_1, n_2, n_bc        whole half wavelengths by 3.13 and 3.16; NaN where Phi - Phi_ZRG - Phi_Cal breaks 3.5
    d_mp                  m, the series 3.19b, with the right whole cycles
    d_0, i_1, i_2, psi    3.20, 3.23, 3.25; psi signed; NaN for a distance shorter than D_0
    delta_range, h_corr   m, 3.28 and 3.29 with the right whole cycles
    h_corr_by_int         m, the same with its own
    """

    n_1: Array
    n_2: Array
    n_bc: Array
    d_mp: Array
    d_0: Array
    i_1: Array
    i_2: Array
    psi: Array
    delta_range: Array
    h_corr: Array
    h_corr_by_int: Array


def median_series(d_1: Array, d_2: Array, d_12: Array, *, delta: Array) -> Array:
    """Distance to the mid-point of the prisms by the memo's series, m.

    d_1, d_2    m, to the prisms
    d_12        m, between them
    delta       m, above 0: N_1 half wavelengths

    It neglects d_12^2 (delta_1 + delta_2) / (16 delta^2), among others: up to 20 um at 18 m. The exact median is 3.17.

    Source: [GOLDMAN00] eq. 3.19b. The 3.19 before it prints (delta_1 + delta_2)/2 inside the root where
    (delta_1 + delta_2)/delta is right.

    >>> exact = np.sqrt((18.05**2 + 18.04**2) / 2 - 0.635**2 / 4)
    >>> round(float(median_series(18.05, 18.04, 0.635, delta=17.95) - exact) * 1e6, 1)
    -14.6
    """
    first, second = d_1 - delta, d_2 - delta
    return delta + 0.5 * (first + second) + (first - second) ** 2 / (8.0 * delta) - d_12**2 / (8.0 * delta)


def memo_numbers(r: TripletReadings, cycles: TripletCycles, lengths: TripletLengths) -> MemoNumbers:
    """Memo's results from the same readings.

    r         readings
    cycles    ours, right
    lengths   ours, exact

    Source: [GOLDMAN00] eqs. 3.13, 3.16, 3.19b, 3.20, 3.23, 3.25 (arctan were right; D_0 is a leg), 3.28, 3.29.
    """
    half, half_fp = half_wavelengths(r)
    zero, zero_fp = r.phi_zrg + r.phi_cal, r.phi_zrg_fp + r.phi_cal_fp
    n_1 = _by_int(r.d_toppl - r.pc_1, r.phi_1 - zero, half)
    n_2 = _by_int(r.d_toppl - r.pc_2, r.phi_2 - zero, half)
    n_bc = _by_int(r.d_toppl - r.pc_b, r.phi_bcfp - zero_fp, half_fp)
    d_0 = np.hypot(r.d_toppl, r.h_s)
    with np.errstate(invalid="ignore"):
        psi = np.arcsin((0.5 - lengths.alpha) * r.d_12 / d_0)
        i_1, i_2 = np.arccos(d_0 / lengths.d_1), np.arccos(d_0 / lengths.d_2)
    middle = 0.5 * (r.l_1 - r.hrp_1 + r.l_2 - r.hrp_2)

    def reduced(d_1: Array, d_2: Array, d_bcfp: Array, n: Array, sine: Array) -> tuple[Array, Array, Array]:
        d_mp = median_series(d_1, d_2, r.d_12, delta=n * half)
        delta_range = (d_mp - d_bcfp) / np.sqrt(1.0 - sine**2)
        return d_mp, delta_range, 2.0 * r.l_post - 2.0 * middle - delta_range

    # 3.11 and 3.15: no dPc at the calibration
    d_1, d_2 = lengths.d_1 - lengths.dpc_1, lengths.d_2 - lengths.dpc_2
    d_mp, delta_range, h_corr = reduced(d_1, d_2, lengths.d_bcfp, cycles.n_1.astype(float), np.sin(psi))
    own_1 = (n_1 - (r.phi_1 - zero) / TWO_PI) * half + r.pc_1
    own_2 = (n_2 - (r.phi_2 - zero) / TWO_PI) * half + r.pc_2
    own_b = (n_bc - (r.phi_bcfp - zero_fp) / TWO_PI) * half_fp + r.pc_b
    with np.errstate(invalid="ignore", divide="ignore"):
        own_sine = (own_2 - own_1) * (own_2 + own_1) / (2.0 * r.d_12 * d_0)
        h_corr_by_int = reduced(own_1, own_2, own_b, n_1, own_sine)[2]
    return MemoNumbers(
        n_1=n_1,
        n_2=n_2,
        n_bc=n_bc,
        d_mp=d_mp,
        d_0=d_0,
        i_1=i_1,
        i_2=i_2,
        psi=psi,
        delta_range=delta_range,
        h_corr=h_corr,
        h_corr_by_int=h_corr_by_int,
    )


def _by_int(coarse: Array, phase: Array, half: Array) -> Array:
    """Whole cycles by INT and sign; NaN outside the rule's domain."""
    coarse, phase, half = np.broadcast_arrays(coarse, phase, half)
    legal = np.abs(phase) < TWO_PI
    return np.where(legal, memo_whole_cycles(coarse, np.where(legal, phase, 0.0), half), np.nan)
