"""Objects on the ground: monuments with heads, benchmarks; feed-arm heads."""

from dataclasses import dataclass

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.simulator.night.faults import Planted, Streams

GROUND_RANGERS = tuple(f"ZY{i}" for i in range(101, 113))
FEED_ARM_RANGERS = tuple(f"ZY{i}" for i in range(113, 119))
U_MONUMENT_MM, U_D0_MM, U_OFFSET_MM, U_LEAKAGE_VOLT, U_BENCHMARK_MM = 0.100, 0.010, 0.005, 0.0008, 0.020
SITE_LATITUDE_DEG, METRES_PER_DEGREE = 38.433121, 110_950.0


@dataclass(frozen=True)
class TrueHead:
    """Ranger head: calibration sheet and true values (`true_...`, SI)."""

    ranger: str
    leakage_amplitude_volt: float
    leakage_phase_rad: float
    d0_mm: float
    offset_mm: np.ndarray  # dx, dy, dz
    beta_rad: np.ndarray
    na0: int
    ne0: int
    true_leakage: complex  # V
    true_d0: float  # m
    true_offset: np.ndarray  # m

    @property
    def zp(self) -> str:
        return "ZP" + self.ranger[2:]


@dataclass(frozen=True)
class TrueMonument:
    """Ground monument: printed survey, true fixed point and scan point.

    m, ground frame. The sheet's latitude and height above the sea are those of `levelled_mm`, or of the survey.
    """

    ranger: str
    fixed_point_mm: np.ndarray
    u_mm: np.ndarray
    azimuth_deg: float
    alpha_rad: np.ndarray
    true_fixed_point: np.ndarray
    true_scan_point: np.ndarray
    levelled_mm: np.ndarray | None = None


@dataclass(frozen=True)
class TrueBenchmark:
    """Hollow cube on the ground at a certified distance to one ranger."""

    name: str
    ranger: str
    neighbour: str | None
    certified_mm: float
    true_point: np.ndarray


def kelvin_from_ground(alpha):
    """Nine elements of the monument's rotation from its angles (rad).

    Source: [PARKER04] eq. 2.5.
    """
    (c1, c2, c3), (s1, s2, s3) = np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [c1 * c2, s1 * c2, s2],
            [-c1 * s2 * c3 + s1 * s3, -s1 * s2 * c3 - c1 * s3, c2 * c3],
            [s1 * c3 + c1 * s2 * s3, -c1 * c3 + s1 * s2 * s3, -c2 * s3],
        ]
    )


def head(ranger: str, streams: Streams, planted: Planted) -> TrueHead:
    """Head with its calibration sheet, drawn for one ranger."""
    rng = streams(f"head/{ranger}")
    amplitude, angle = round(rng.uniform(0.012, 0.040), 5), round(rng.uniform(0.0, 2 * np.pi), 4)
    d0_mm = round(rng.normal(180.3, 0.5), 3)
    offset_mm = np.round(rng.normal([0.0, 247.4, -0.8], [0.1, 0.2, 0.18]), 3)
    beta = np.round(rng.normal(0.0, [6e-4, 1e-4]), 6)
    na0, ne0 = (int(v) for v in rng.integers(-5500, 5500, 2))
    miss = planted.gain("calibration") * rng.normal(size=6)
    leakage = amplitude * np.exp(1j * angle) + U_LEAKAGE_VOLT * complex(miss[0], miss[1])
    return TrueHead(
        ranger=ranger,
        leakage_amplitude_volt=amplitude,
        leakage_phase_rad=angle,
        d0_mm=d0_mm,
        offset_mm=offset_mm,
        beta_rad=beta,
        na0=na0,
        ne0=ne0,
        true_leakage=planted.gain("leakage") * leakage,
        true_d0=(d0_mm + U_D0_MM * miss[2] + planted.d0_error_mm.get(ranger, 0.0)) * MILLIMETRE,
        true_offset=planted.gain("mirror_offset") * (offset_mm + U_OFFSET_MM * miss[3:]) * MILLIMETRE,
    )


def monument(ranger: str, head: TrueHead, streams: Streams, *, planted: Planted) -> TrueMonument:
    """Monument some 120 m from the pintle bearing, pointing at it.

    With the true scan point of its head.
    """
    rng = streams(f"monument/{ranger}")
    bearing = (12.0 + 30.0 * GROUND_RANGERS.index(ranger) + rng.uniform(-5.0, 5.0)) * DEGREE
    radius, height = rng.normal(120.0, 1.1), rng.normal(0.0, 0.5)
    defines_height = ranger == "ZY103"  # z = 0 by definition, no uncertainty
    place = [radius * np.sin(bearing), radius * np.cos(bearing), 0.0 if defines_height else height]
    fixed_mm = np.round(np.array(place) / MILLIMETRE, 3)
    u_mm = U_MONUMENT_MM * np.array([1.0, 1.0, 0.0 if defines_height else 1.0])
    azimuth_deg = round(float((bearing / DEGREE + 180.0 + rng.normal(0.0, 0.01)) % 360.0), 6)
    alpha = np.round(np.array([np.pi - azimuth_deg * DEGREE, *rng.normal(0.0, 7e-5, 2)]), 7)
    fixed = (fixed_mm + planted.gain("calibration") * u_mm * rng.normal(size=3)) * MILLIMETRE
    return TrueMonument(
        ranger=ranger,
        fixed_point_mm=fixed_mm,
        u_mm=u_mm,
        azimuth_deg=azimuth_deg,
        alpha_rad=alpha,
        true_fixed_point=fixed,
        true_scan_point=fixed + kelvin_from_ground(alpha).T @ head.true_offset,
    )


def benchmarks(monuments: dict[str, TrueMonument], streams: Streams, planted: Planted) -> list[TrueBenchmark]:
    """Six benchmarks, 60 to 140 m along chords of the ring.

    Each is certified from its own ranger.
    """
    marks = []
    for k in range(6):
        rng = streams(f"benchmark/{k}")
        ranger = GROUND_RANGERS[2 * k + 1]
        station = monuments[ranger].true_scan_point
        ring, radius = float(np.hypot(*station[:2])), rng.uniform(98.0, 116.0)
        distance = 60.2 + 15.95 * k + rng.normal(0.0, 0.3)
        turn = np.arccos((ring**2 + radius**2 - distance**2) / (2.0 * ring * radius))
        bearing = np.arctan2(station[0], station[1]) + turn
        point = np.array([radius * np.sin(bearing), radius * np.cos(bearing), rng.uniform(-0.4, 1.2)])
        certified = np.linalg.norm(point - station) / MILLIMETRE + planted.gain("calibration") * rng.normal(
            0.0, U_BENCHMARK_MM
        )
        neighbour = GROUND_RANGERS[2 * k + 2] if k % 2 == 0 else None
        marks.append(TrueBenchmark(f"ZBM{k + 1:02d}", ranger, neighbour, round(float(certified), 3), point))
    return marks
