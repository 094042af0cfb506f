"""Height of a triplet's ball above the prisms' mid-point, from phases.

Exact, for arrays of placements.

Axes at the synthetic reference plane: along the line of the prisms (left to right), up, and the normal towards the
ranger. The unit is flipped about the line of its centres and pushed against the same stops, so that a point at the
height t above the plane comes to -t and stays where it was in the plane. With Z the depth of a point below the scan
point along the normal,

    Z_MP = Z_plane - (L_MP - L_post),  Z_BCfp = Z_plane + (L_BC - L_post),  Z_MP - Z_BCfp = 2 L_post - 2 L_MP - H_corr.

Three ranges determine both depths: D_MP from the median (3.17), the scan point's place along the prisms from D_1^2 -
D_2^2, its height from h_S. No plane need be perpendicular to the beam: a tilt of the stops is a lateral offset of the
scan point, which D_1 and D_2 show. The memo's (D_MP - D_BCfp) sec Psi (3.28) is the same to first order; the secant
correctly multiplies: a distance changes by less than the depth, dD = dZ cos Psi.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.optics.retroreflector import prism
from catseye.signal.cycles.whole import whole_cycles

Values = float | Array


@dataclass(frozen=True, eq=False)
class TripletReadings:
    """Readings and constants, arrays that broadcast together.

    Metres, radians. `_fp` is after the flip.

    A number becomes an array without axes.

    phi_1, phi_2, phi_zrg, phi_cal            phases, prisms towards the ranger
    phi_bcfp, phi_zrg_fp, phi_cal_fp          phases, ball towards the ranger
    eta_a, eta_a_fp                           group index of the air
    d_toppl, h_s, d_12                        coarse distance, height of the scan point, between the prisms
    l_1, l_2, l_bt, l_post                    heights on the surface plate
    height_1, height_2, hrp_1, hrp_2          of the prisms: face to corner, face to fiducial point
    pc_1, pc_2, pc_b, r_1, n                  range constants, radius of the ball, index ratio of the glass
    ball_along, ball_up                       ball centre from the prisms' mid-point, in the plate as flipped
    modulation_hz                             Hz
    """

    phi_1: Array
    phi_2: Array
    phi_zrg: Array
    phi_cal: Array
    phi_bcfp: Array
    phi_zrg_fp: Array
    phi_cal_fp: Array
    eta_a: Array
    eta_a_fp: Array
    d_toppl: Array
    h_s: Array
    d_12: Array
    l_1: Array
    l_2: Array
    l_bt: Array
    l_post: Array
    height_1: Array
    height_2: Array
    hrp_1: Array
    hrp_2: Array
    pc_1: Array
    pc_2: Array
    pc_b: Array
    r_1: Array
    n: Array
    ball_along: Array = field(default_factory=lambda: np.asarray(0.0))
    ball_up: Array = field(default_factory=lambda: np.asarray(0.0))
    modulation_hz: Array = field(default_factory=lambda: np.asarray(1500e6))

    def __post_init__(self) -> None:
        for item in fields(self):
            object.__setattr__(self, item.name, np.asarray(getattr(self, item.name), dtype=float))

    def moved(self, by: Mapping[str, Array]) -> "TripletReadings":
        """Readings with some values shifted."""
        return replace(self, **{name: getattr(self, name) + change for name, change in by.items()})


@dataclass(frozen=True, eq=False)
class TripletCycles:
    """Whole half wavelengths N as in (3.11), with margin.

    The margin, m, is the additional error of D_TOPPL before N changes: the least of three.
    """

    n_1: NDArray[np.int64]
    n_2: NDArray[np.int64]
    n_bc: NDArray[np.int64]
    margin: Array


@dataclass(frozen=True, eq=False)
class TripletLengths:
    """Lengths and angles from readings and whole cycles.

    Metres, radians, in the memo's symbols (`i` an incidence).

    d_1, d_2, d_bcfp        scan point to the left and right fiducial point, and to the ball's centre after the flip
    d_mp                    to the mid-point, the exact median (3.17)
    alpha                   foot of the perpendicular from the scan point, share of d_12 from the left prism (3.22)
    i_1, i_2                incidence on the prisms, against the normal of the synthetic plane
    dpc_1, dpc_2            change of the range constants with incidence (B.1), never positive
    psi                     between the line of sight to the mid-point and the normal, 0 or more
    depth_mp, depth_bcfp    of both points along the normal
    delta_range             depth_mp - depth_bcfp
    along, up               scan point from the mid-point, in the synthetic plane
    h_corr, l_mpbc          ball centre above the mid-point along the normal: by ranging, by the surface plate
    """

    d_1: Array
    d_2: Array
    d_bcfp: Array
    d_mp: Array
    alpha: Array
    i_1: Array
    i_2: Array
    dpc_1: Array
    dpc_2: Array
    psi: Array
    depth_mp: Array
    depth_bcfp: Array
    delta_range: Array
    along: Array
    up: Array
    h_corr: Array
    l_mpbc: Array


def half_wavelengths(readings: TripletReadings) -> tuple[Array, Array]:
    """HWLA before and after the flip, m."""
    vacuum = 0.5 * SPEED_OF_LIGHT / readings.modulation_hz
    return vacuum / readings.eta_a, vacuum / readings.eta_a_fp


def triplet_cycles(r: TripletReadings) -> TripletCycles:
    """Whole half wavelengths by the nearest integer.

    To the coarse length plus the phase's share.

    r   readings; d_toppl correct within the margin, 40 mm and more

    The coarse distance to a prism includes that it stands half of d_12 aside, 2.8 mm at 18 m.

    Source: [GOLDMAN00] eq. 3.11 solved for N. Its own rule (3.13, 3.16) uses INT and slips where true and coarse
    length straddle a whole half wavelength: see `memo`.
    """
    half, half_fp = half_wavelengths(r)
    aside = np.sqrt(r.d_toppl**2 + r.h_s**2 + 0.25 * r.d_12**2)
    before, after = _phases(r)
    n_1, m_1 = whole_cycles(aside - r.pc_1, before(r.phi_1), half)
    n_2, m_2 = whole_cycles(aside - r.pc_2, before(r.phi_2), half)
    n_bc, m_bc = whole_cycles(np.hypot(r.d_toppl, r.h_s) - r.pc_b, after(r.phi_bcfp), half_fp)
    return TripletCycles(n_1, n_2, n_bc, np.minimum(np.minimum(m_1, m_2), m_bc))


def triplet_lengths(r: TripletReadings, cycles: TripletCycles) -> TripletLengths:
    """Lengths and angles of a calibration, exact; NaN without a triangle.

    r         readings
    cycles    whole half wavelengths

    Source: [GOLDMAN00] eqs. 3.11, 3.14, 3.15, 3.17, 3.22, 3.26, 3.29, B.1; the depths by exact geometry (module) for
    3.20 to 3.25 and 3.28. Exact, but for the ball's centre in the plate (`ball_along`, `ball_up`), which ranges of one
    direction do not determine.
    """
    half, half_fp = half_wavelengths(r)
    before, after = _phases(r)
    d_1 = (cycles.n_1 - before(r.phi_1) / TWO_PI) * half + r.pc_1
    d_2 = (cycles.n_2 - before(r.phi_2) / TWO_PI) * half + r.pc_2
    d_bcfp = (cycles.n_bc - after(r.phi_bcfp) / TWO_PI) * half_fp + r.pc_b
    low, high = r.l_1 - r.hrp_1, r.l_2 - r.hrp_2
    _, depth, _, _ = _scan_point(r, d_1, d_2, high - low)
    # incidences from lengths that lack dPc, some nm: they change by 1e-10 rad
    i_1, i_2 = _arccos((depth + 0.5 * (high - low)) / d_1), _arccos((depth - 0.5 * (high - low)) / d_2)
    dpc_1 = _obliquity(r.height_1, r.n, i_1)
    dpc_2 = _obliquity(r.height_2, r.n, i_2)
    d_1, d_2 = d_1 + dpc_1, d_2 + dpc_2
    d_mp, depth, along, up = _scan_point(r, d_1, d_2, high - low)
    depth_bcfp = _root(d_bcfp**2 - (along - r.ball_along) ** 2 - (up - r.ball_up) ** 2)
    middle = 0.5 * (low + high)
    delta_range = depth - depth_bcfp
    return TripletLengths(
        d_1=d_1,
        d_2=d_2,
        d_bcfp=d_bcfp,
        d_mp=d_mp,
        alpha=0.5 + (d_1 - d_2) * (d_1 + d_2) / (2.0 * r.d_12**2),
        i_1=i_1,
        i_2=i_2,
        dpc_1=dpc_1,
        dpc_2=dpc_2,
        psi=np.arctan2(np.hypot(along, up), depth),
        depth_mp=depth,
        depth_bcfp=depth_bcfp,
        delta_range=delta_range,
        along=along,
        up=up + 0.0 * depth,
        h_corr=2.0 * r.l_post - 2.0 * middle - delta_range,
        l_mpbc=r.l_bt + r.r_1 - middle,
    )


def _phases(r: TripletReadings) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """Functions that correct a phase for reference and calibration.

    Before and after the flip; not reduced.
    """
    zero, zero_fp = r.phi_zrg + r.phi_cal, r.phi_zrg_fp + r.phi_cal_fp
    return (lambda phi: phi - zero), (lambda phi: phi - zero_fp)


def _scan_point(r: TripletReadings, d_1: Array, d_2: Array, rise: Array) -> tuple[Array, Array, Array, Array]:
    """Distance D_MP and the scan point from the mid-point, exact.

    Depth along the normal, along the prisms, up.

    rise   of the right fiducial point over the left, towards the ranger: the line of the prisms leans by as much
    """
    d_12, up = r.d_12, r.h_s
    d_mp = _root(0.5 * (d_1**2 + d_2**2) - 0.25 * d_12**2)
    on_line = (d_1 - d_2) * (d_1 + d_2) / (2.0 * d_12)
    across = _root(d_mp**2 - on_line**2 - up**2)
    sine = rise / d_12
    cosine = np.sqrt(1.0 - sine**2)
    return d_mp, across * cosine + on_line * sine, on_line * cosine - across * sine, up


def _root(square: Array) -> Array:
    with np.errstate(invalid="ignore"):
        return np.sqrt(square)


def _arccos(cosine: Array) -> Array:
    """Arc cosine; NaN beyond 1 except for rounding."""
    cosine = np.where((cosine > 1.0) & (cosine < 1.0 + 1e-12), 1.0, cosine)
    with np.errstate(invalid="ignore"):
        return np.arccos(cosine)


def _obliquity(height: Array, n: Array, incidence: Array) -> Array:
    return np.asarray(prism.obliquity_correction(height, n, np.cos(incidence)))
