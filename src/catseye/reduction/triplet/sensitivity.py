"""Errors of H_corr and the ball by departures from design or calibration.

By exact geometry.

The unit, the flip and the scan point are placed in three dimensions and their distances turned into phases; the
calibration's own reduction (`geometry`), told the design, gives H_corr. On the telescope the same unit is
ranged from any direction and reduced by `use`.

Effect of the flip on the glass: the ball's constant cancels and the prisms' counts twice. With ranges to the prisms e_p
too long and to the ball e_b, the calibration gives H_corr + e_b - e_p; in use the mid-point seems e_p deeper, and from
the other side the ground sees the ball e_b deeper; so ground and feed arm need H_corr + e_b + e_p. They disagree by
2 e_p along the normal, whatever e_b is. The surface plate's L_MPBC contains the small radius but no path in glass: in
the place of H_corr it would leave e_b + e_p, and the error of R_1.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import DEGREE, SPEED_OF_LIGHT, TWO_PI
from catseye.optics.retroreflector.prism import obliquity_correction
from catseye.reduction.triplet.geometry import TripletReadings, Values, triplet_cycles, triplet_lengths
from catseye.reduction.triplet.tolerances import D_12, RATIO, TOLERANCE, ratio_change
from catseye.reduction.triplet.use import ball_distance, median

INCH = 0.0254
HEIGHT, R_1, R_2, POST = 1.5 * INCH, 1.969 * INCH, 3.799 * INCH, 3.5 * INCH  # m: prism, ball, fixture
INDEX, MODULATION = 1.000253247, 1500e6  # of air at 20 deg C, 933 hPa, 50 %; Hz
FIDUCIALS, BALL = -0.10e-3, -0.04e-3  # m, above the synthetic plane: paint, and a ball 60 um above the prisms


@dataclass(frozen=True)
class Departures:
    """Departures from the assumptions, true minus assumed.

    Arrays that broadcast, metres and radians.

    spacing                         between the prisms
    along, across                   ball from the prisms' mid-point in the plate, unit's x and y
    slip_along, slip_up, slip_out   of the whole unit as it is flipped; out is towards the ranger
    scan_height                     of the scan point above the prisms' line, h_S
    index, index_flipped            group index of the air before and after the flip
    ratio                           group index of all glass over the air's
    height, radius_1, radius_2      of both prisms' glass, of the ball's small and large sphere
    lean_x, lean_y                  on the telescope: the plate's normal against its assumed direction
    """

    spacing: Values = 0.0
    along: Values = 0.0
    across: Values = 0.0
    slip_along: Values = 0.0
    slip_up: Values = 0.0
    slip_out: Values = 0.0
    scan_height: Values = 0.0
    index: Values = 0.0
    index_flipped: Values = 0.0
    ratio: Values = 0.0
    height: Values = 0.0
    radius_1: Values = 0.0
    radius_2: Values = 0.0
    lean_x: Values = 0.0
    lean_y: Values = 0.0

    @property
    def prism_excess(self) -> Values:
        """Error of a range to a prism at normal incidence, m (positive: too long)."""
        return (RATIO + self.ratio) * (HEIGHT + self.height) - RATIO * HEIGHT

    @property
    def ball_excess(self) -> Values:
        """Error of a range to the ball's centre, m (positive: too long)."""
        small, large = R_1 + self.radius_1, R_2 + self.radius_2
        return (RATIO + self.ratio) * (small + large) - small - RATIO * (R_1 + R_2) + R_1


def calibration_error(d: Departures, *, depth: Values = 18.0, aside: Values = 0.0, above: Values = 0.0) -> Array:
    """Error of H_corr by the calibration, m.

    d               departures
    depth           m, of the synthetic plane below the scan point
    aside, above    m, of the scan point from the unit's middle, along the prisms and up

    Source: [GOLDMAN00] sections 2.3 and 3.2, placed in three dimensions. Exact, but for the change of a wrong prism's
    obliquity correction, a millionth of the error.

    >>> round(float(calibration_error(Departures(slip_out=1e-5))) * 1e6, 3)
    -10.0
    """
    scan = (aside, above, depth)
    half = 0.5 * (D_12 + d.spacing)
    d_1 = _length(scan, (-half, 0.0, FIDUCIALS))
    d_2 = _length(scan, (half, 0.0, FIDUCIALS))
    d_b = _length(scan, (d.along + d.slip_along, d.slip_up - d.across, d.slip_out - BALL))
    pc = HEIGHT / RATIO - RATIO * HEIGHT
    ways = [
        (one - pc - _obliquity((depth - FIDUCIALS) / one) + d.prism_excess) * (INDEX + d.index) for one in (d_1, d_2)
    ]
    pc_b = R_1 - RATIO * (R_1 + R_2)
    ways.append((d_b - pc_b + d.ball_excess) * (INDEX + d.index_flipped))
    cycle = 0.5 * SPEED_OF_LIGHT / MODULATION
    phi = [np.mod(-TWO_PI * path / cycle, TWO_PI) for path in ways]
    face = POST + FIDUCIALS + HEIGHT / RATIO
    numbers = {
        "phi_zrg": 0.0, "phi_cal": 0.0, "phi_zrg_fp": 0.0, "phi_cal_fp": 0.0, "eta_a": INDEX, "eta_a_fp": INDEX,
        "d_12": D_12, "l_1": face, "l_2": face, "l_post": POST, "height_1": HEIGHT, "height_2": HEIGHT,
        "hrp_1": HEIGHT / RATIO, "hrp_2": HEIGHT / RATIO, "pc_1": pc, "pc_2": pc, "pc_b": pc_b,
        "r_1": R_1, "n": RATIO, "modulation_hz": MODULATION,
    }  # fmt: skip
    readings = TripletReadings(
        phi_1=phi[0],
        phi_2=phi[1],
        phi_bcfp=phi[2],
        d_toppl=np.asarray(depth),
        h_s=np.asarray(above) - d.scan_height,
        l_bt=np.asarray(POST + BALL - R_1 - d.radius_1),
        **{name: np.asarray(number) for name, number in numbers.items()},
    )
    return triplet_lengths(readings, triplet_cycles(readings)).h_corr - (BALL - FIDUCIALS)


def telescope_error(d: Departures, *, scan_point: ArrayLike, h_error: Values = 0.0) -> Array:
    """Error of the distance to the ball's centre by two prism ranges, m.

    d            departures; the laboratory's (slips, indices of its air, h_S) have no effect here
    scan_point   (..., 3) m, from the mid-point in the unit's axes
    h_error      m, error of H_corr (positive: too large)

    Source: [GOLDMAN00] appendix C, placed in three dimensions. Exact.

    >>> beside = 46.0 * np.array([np.sin(np.radians(12.0)), 0.0, np.cos(np.radians(12.0))])
    >>> round(float(telescope_error(Departures(along=0.15e-3), scan_point=beside)) * 1e6, 2)
    31.19
    """
    s = np.asarray(scan_point, dtype=float)
    scan = tuple(np.moveaxis(s, -1, 0))
    half, h_corr = 0.5 * (D_12 + d.spacing), BALL - FIDUCIALS
    true = _length(scan, (d.along, d.across, h_corr))
    assumed = np.stack(np.broadcast_arrays(-np.tan(d.lean_x), -np.tan(d.lean_y), 1.0), axis=-1)
    assumed = assumed / np.linalg.norm(assumed, axis=-1, keepdims=True)
    ranges = []
    for side in (-1.0, 1.0):
        one = _length(scan, (side * half, 0.0, 0.0))
        towards = (s - np.array([side * 0.5 * D_12, 0.0, 0.0])) / one[..., None]
        applied = _obliquity(np.sum(assumed * towards, axis=-1))
        ranges.append(one + d.prism_excess - _obliquity(scan[2] / one) + applied)
    sight = s - h_corr * np.array([0.0, 0.0, 1.0])
    sight = sight / np.linalg.norm(sight, axis=-1, keepdims=True)
    d_mp = median(ranges[0], ranges[1], D_12)
    return ball_distance(d_mp, sight, np.asarray(h_corr + h_error)[..., None] * assumed) - true


class LargestEffects(NamedTuple):
    """Largest effects of one cause at both its signs, m.

    cause         in words
    size          in words, with its unit
    memo          the memo's bound in its calibration, m; NaN where it has none
    calibration   in H_corr
    use           in the distance to the ball's centre by a right H_corr
    tie           disagreement of feed arm and ground, straight through the unit, with the calibration's own H_corr
    """

    cause: str
    size: str
    memo: float
    calibration: float
    use: float
    tie: float


def triplet_sensitivities(
    *,
    depth: float = 18.0,
    aside: float = 0.5 * D_12,
    above: float = 0.05,
    distance: float = 46.0,
    incidence: float = 12.0 * DEGREE,
) -> tuple[LargestEffects, ...]:
    """Table of effects, each cause alone at its tolerance.

    The worst sign and the worst direction on the telescope.

    depth, aside, above    m, of the scan point at the calibration; A.8's bound is for the perpendicular on a prism
    distance, incidence    m, rad, on the telescope: the nearest, the most oblique

    Source: [GOLDMAN00] appendices A and D; tolerances of section 1.3 where it has them.
    """
    azimuth = np.linspace(0.0, TWO_PI, 72, endpoint=False)
    around = distance * np.stack(
        [np.sin(incidence) * np.cos(azimuth), np.sin(incidence) * np.sin(azimuth), np.full(72, np.cos(incidence))],
        axis=1,
    )
    ahead = np.array([0.0, 0.0, distance])
    rows = []
    for cause, size, memo, values in _causes():
        departures = [Departures(**{k: sign * v for k, v in values.items()}) for sign in (-1.0, 1.0)]
        h = [calibration_error(d, depth=depth, aside=aside, above=above) for d in departures]
        used = [np.abs(telescope_error(d, scan_point=around)).max() for d in departures]
        tie = [
            telescope_error(d, scan_point=ahead, h_error=e) + d.ball_excess for d, e in zip(departures, h, strict=True)
        ]
        rows.append(
            LargestEffects(
                cause=cause,
                size=size,
                memo=memo,
                calibration=float(np.abs(h).max()),
                use=float(max(used)),
                tie=float(np.abs(tie).max()),
            )
        )
    return tuple(rows)


def _causes() -> list[tuple[str, str, float, Mapping[str, float]]]:
    hot = float(ratio_change(-17.2e-6))
    t = TOLERANCE
    return [
        ("prisms further apart", "0.15 mm", 1.4e-6, {"spacing": t}),
        ("ball along the prisms' line", "0.15 mm", 3e-6, {"along": t}),
        ("ball across it, in the plate", "0.15 mm", 3e-6, {"across": t}),
        ("unit slips along at the flip", "0.15 mm", np.nan, {"slip_along": t}),
        ("unit slips up at the flip", "0.15 mm", np.nan, {"slip_up": t}),
        ("unit not against its stops at the flip", "0.01 mm", np.nan, {"slip_out": 1e-5}),
        ("h_S misread", "5 mm", np.nan, {"scan_height": 5e-3}),
        ("prism heights as catalogued", "0.25 mm", np.nan, {"height": 0.25e-3}),
        ("prism heights as measured", "0.002 mm", np.nan, {"height": 2e-6}),
        ("small radius of the ball", "0.01 mm", np.nan, {"radius_1": 1e-5}),
        ("large radius of the ball", "0.01 mm", np.nan, {"radius_2": 1e-5}),
        ("N-BK7 for old BK 7", "1.15e-5", np.nan, {"ratio": 1.15e-5}),
        ("tabulated P_c in air of 40 °C", "20 °C", np.nan, {"ratio": hot}),
        ("thermometer, both ways round", "1 °C", np.nan, {"index": -0.896e-6, "index_flipped": -0.896e-6}),
        ("temperature moves before the flip", "1 °C", np.nan, {"index_flipped": -0.896e-6}),
        ("plate's normal, towards a prism", "0.3°", np.nan, {"lean_x": 0.3 * DEGREE}),
        ("plate's normal, up", "0.3°", np.nan, {"lean_y": 0.3 * DEGREE}),
    ]


def _length(a: tuple[Values, ...], b: tuple[Values, ...]) -> Array:
    return np.asarray(np.sqrt(sum((np.asarray(p, dtype=float) - q) ** 2 for p, q in zip(a, b, strict=True))))


def _obliquity(cosine: Values) -> Array:
    return obliquity_correction(HEIGHT, RATIO, cosine)
