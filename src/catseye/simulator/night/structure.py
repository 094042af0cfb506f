"""Telescope of one night: true and typed places of its equipment."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from catseye.constants import DEGREE, MILLIMETRE
from catseye.records.site.retroreflector import BALL, HOLLOW, PRISM, RetroreflectorKind
from catseye.simulator.night.faults import Faults, Planted, Streams
from catseye.simulator.night.posture import TruePosture
from catseye.simulator.night.world import FEED_ARM_RANGERS

FOCAL_LENGTH = 60.0
APERTURE_CENTRE, APERTURE_RADIUS = np.array([0.0, 54.0]), 50.0
FEED_ARM_DESIGN = np.array(
    [
        [-8.900, -3.100, 60.850],
        [9.115, -2.920, 61.130],
        [-7.600, -9.090, 51.840],
        [7.450, -9.200, 51.835],
        [-2.180, 0.340, 66.190],
        [2.175, -11.950, 43.850],
    ]
)
AIM_POINT_DESIGN = np.array([0.0, -5.985, 55.950])
STRUCTURAL_REFLECTOR = {"ZEG41040L": (-2.670, -4.240, 57.300), "ZEG20440L": (-3.170, -9.470, 11.850)}
STRUCTURAL_ALIDADE = {"ZAG731P": (-22.320, 1.340, 46.870), "ZAG731D": (22.360, 1.240, 46.930)}
TRIPLET_RADIUS, TRIPLET_HEIGHT = 50.350, 0.250
U_HEIGHT_MM, U_RADIUS_MM, U_D12_MM, U_H_CORR_MM, U_L_MPBC_MM, U_LATERAL_MM = 0.002, 0.003, 0.030, 0.020, 0.045, 0.040
WEDGE_DEG = 10.0  # the dish prisms stand on wedges of multiples of this


@dataclass(frozen=True)
class TrueTarget:
    """Target with typed values and truth.

    `normal` is the axis, towards the rangers; None for a kind without one.
    """

    name: str
    kind: RetroreflectorKind
    frame: str
    position_mm: np.ndarray  # as typed
    point: np.ndarray  # true, m, ground frame
    normal_typed: np.ndarray | None = None
    normal: np.ndarray | None = None  # true, ground frame
    sizes_mm: tuple[float, ...] = ()  # typed: prism height, or ball radii
    sizes: tuple[float, ...] = ()  # true, m

    def __post_init__(self) -> None:
        self.kind.axis_of(self.name, self.normal)


@dataclass(frozen=True)
class TrueTriplet:
    """Triplet unit: data sheet and three targets (left, right, ball)."""

    name: str
    position_mm: np.ndarray
    normal: np.ndarray
    axis: np.ndarray
    d12_mm: float
    h_corr_mm: float
    l_mpbc_mm: float
    design: np.ndarray  # of the ball, m, reflector frame
    targets: tuple[TrueTarget, TrueTarget, TrueTarget]

    @property
    def plate(self) -> tuple[TrueTarget, TrueTarget]:
        """Both prisms, left and right."""
        return self.targets[0], self.targets[1]


@dataclass(frozen=True)
class Structure:
    """All targets on the telescope."""

    feed_arm: dict[str, TrueTarget]
    dish: list[TrueTarget]
    triplets: list[TrueTriplet]
    structural: list[TrueTarget]
    aim_point_mm: np.ndarray
    design: dict[str, np.ndarray]  # where ground rangers look for balls and structural targets, m, ground frame
    wrongly_typed: str | None

    @property
    def targets(self) -> dict[str, TrueTarget]:
        units = [t for unit in self.triplets for t in unit.targets]
        return {t.name: t for t in (*self.feed_arm.values(), *self.dish, *units, *self.structural)}


def unit(vector):
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def tilted(direction, tilt_deg, rng):
    """Direction turned by normal draws of `tilt_deg` about two axes.

    One sigma a component, the axes across it.
    """
    return unit(direction + np.cross(direction, rng.normal(0.0, tilt_deg * DEGREE, np.shape(direction))))


def typing_error(planted: Planted, rng, shape=3):
    """Errors of approximate positions, m: 8 mm, at most 15 mm a coordinate."""
    return planted.gain("typing") * np.clip(rng.normal(0.0, 8.0, shape), -15.0, 15.0) * MILLIMETRE


def typed_mm(point):
    return np.round(point / MILLIMETRE, 1)


def surface_deviations(xy, streams: Streams, planted: Planted, *, rms_mm: float = 0.3):
    """Normal deviations of dish prisms, m, positive towards the focus.

    Low orders of the aperture and a random part.
    """
    rng = streams("surface")
    x, y = ((xy - APERTURE_CENTRE) / APERTURE_RADIUS).T
    r2 = x**2 + y**2
    orders = np.array(
        [x**2 - y**2, 2 * x * y, (3 * r2 - 2) * x, (3 * r2 - 2) * y, x**3 - 3 * x * y**2, 6 * r2**2 - 6 * r2 + 1]
    )
    raw = rng.normal(size=6) @ orders + rng.normal(0.0, 0.5, len(xy))
    return planted.gain("surface") * rms_mm * MILLIMETRE * raw / np.sqrt(np.mean(raw**2))


def height_above_vertex(xy):
    return np.sum(xy**2, axis=-1) / (4.0 * FOCAL_LENGTH)


def dish_prisms(count: int, pose: TruePosture, streams: Streams, *, planted: Planted) -> list[TrueTarget]:
    """Dish prisms in a sunflower pattern, on wedges towards the feed arm.

    The wedges aim them only roughly.
    """
    if count == 0:
        return []
    rng = streams("dish")
    k = np.arange(count)
    spread = 0.97 * APERTURE_RADIUS * np.sqrt((k + 0.5) / count) * rng.uniform(0.98, 1.0, count)
    swing = k * np.pi * (3.0 - np.sqrt(5.0)) + rng.normal(0.0, 0.04, count)
    xy = APERTURE_CENTRE + (spread * np.array([np.cos(swing), np.sin(swing)])).T
    upwards = unit(np.column_stack((-xy / (2.0 * FOCAL_LENGTH), np.ones(count))))
    ideal = np.column_stack((xy, height_above_vertex(xy)))
    point = ideal + surface_deviations(xy, streams, planted)[:, None] * upwards
    typed_xy = xy + typing_error(planted, rng, (count, 2))
    typed = np.column_stack((typed_xy, height_above_vertex(typed_xy)))

    aim = unit(AIM_POINT_DESIGN - ideal)
    lean = np.arccos(np.clip(np.sum(aim * upwards, axis=1), -1.0, 1.0)) / DEGREE
    short = np.where(rng.uniform(size=count) < 0.12, 2.0, 0.0)  # some got a wedge two sizes too small
    wedge = WEDGE_DEG * np.maximum(np.round(lean / WEDGE_DEG) - short, 0.0)
    across = unit(np.cross(upwards, aim))
    normal = np.round(Rotation.from_rotvec(across * (wedge * DEGREE)[:, None]).apply(upwards), 5)
    true_normal = tilted(unit(normal), planted.gain("normals") * 0.1, rng)
    heights = np.round(rng.normal(38.10, 0.08, count), 3)
    true_heights = (heights + planted.gain("calibration") * rng.normal(0.0, U_HEIGHT_MM, count)) * MILLIMETRE
    points, normals = pose.dish(point), pose.dish_direction(true_normal)
    return [
        TrueTarget(
            name=f"DP{i + 1:03d}",
            kind=PRISM,
            frame="reflector",
            position_mm=typed_mm(typed[i]),
            point=points[i],
            normal_typed=normal[i],
            normal=normals[i],
            sizes_mm=(float(heights[i]),),
            sizes=(float(true_heights[i]),),
        )
        for i in range(count)
    ]


def triplet(number: int, count: int, pose: TruePosture, *, streams: Streams, planted: Planted) -> TrueTriplet:
    """Triplet at the rim, plate to the aim point, ball the other way."""
    rng = streams(f"triplet/{number}")
    calibration = planted.gain("calibration")
    name = f"TR{number:02d}"
    around = (18.0 + 360.0 / count * (number - 1) + rng.normal(0.0, 1.5)) * DEGREE
    out = np.array([np.cos(around), np.sin(around)])
    xy = APERTURE_CENTRE + TRIPLET_RADIUS * out
    ball = np.array([*xy, height_above_vertex(xy) + TRIPLET_HEIGHT])
    typed = typed_mm(ball + typing_error(planted, rng))
    normal = np.round(unit(AIM_POINT_DESIGN - ball), 5)
    clockwise = np.array([out[1], -out[0], 0.0])
    axis = np.round(unit(clockwise - clockwise @ unit(normal) * unit(normal)), 5)
    true_normal = tilted(unit(normal), planted.gain("normals") * 0.3, rng)
    true_axis = tilted(unit(axis), planted.gain("normals") * 0.3, rng)
    true_axis = unit(true_axis - true_axis @ true_normal * true_normal)

    d12_mm, h_mm = round(635.0 + rng.normal(0.0, 0.04), 3), round(rng.normal(0.10, 0.09), 3)
    miss = rng.normal(size=5) * (U_D12_MM, U_H_CORR_MM, U_LATERAL_MM, U_LATERAL_MM, U_L_MPBC_MM)
    d12 = (d12_mm + calibration * miss[0]) * MILLIMETRE
    true_h_mm = h_mm + calibration * miss[1]
    lateral = planted.gain("lateral") * (miss[2] * true_axis + miss[3] * np.cross(true_normal, true_axis)) * MILLIMETRE
    middle = ball - planted.gain("h_corr") * true_h_mm * MILLIMETRE * true_normal - lateral
    heights = np.round(rng.normal(38.40, 0.06, 2), 3)
    radii = np.round(rng.normal([50.010, 96.495], [0.006, 0.008]), 3)
    true_heights = (heights + calibration * rng.normal(0.0, U_HEIGHT_MM, 2)) * MILLIMETRE
    true_radii = (radii + calibration * rng.normal(0.0, U_RADIUS_MM, 2)) * MILLIMETRE
    ground_normal = pose.dish_direction(true_normal)

    prisms = [
        TrueTarget(
            name=f"{name}-{side}",
            kind=PRISM,
            frame="reflector",
            position_mm=typed + sign * d12_mm / 2.0 * axis,
            point=pose.dish(middle + sign * d12 / 2.0 * true_axis),
            normal_typed=normal,
            normal=ground_normal,
            sizes_mm=(float(heights[i]),),
            sizes=(float(true_heights[i]),),
        )
        for i, (side, sign) in enumerate((("L", -1.0), ("R", 1.0)))
    ]
    looker = TrueTarget(
        name=f"{name}-B",
        kind=BALL,
        frame="reflector",
        position_mm=typed,
        point=pose.dish(ball),
        normal_typed=-normal,
        normal=-ground_normal,
        sizes_mm=tuple(float(r) for r in radii),
        sizes=tuple(float(r) for r in true_radii),
    )
    l_mpbc_mm = round(float(h_mm + miss[1] + miss[4]), 3)
    return TrueTriplet(
        name=name,
        position_mm=typed,
        normal=normal,
        axis=axis,
        d12_mm=d12_mm,
        h_corr_mm=h_mm,
        l_mpbc_mm=l_mpbc_mm,
        design=ball,
        targets=(prisms[0], prisms[1], looker),
    )


def structure(
    pose: TruePosture, *, dish_count: int, triplet_count: int, streams: Streams, faults: Faults, planted: Planted
) -> Structure:
    """Telescope in one posture, with one mistyped approximate position."""
    rng = streams("feed_arm")
    place = FEED_ARM_DESIGN + rng.normal(0.0, 0.01, FEED_ARM_DESIGN.shape)
    arm_typed = typed_mm(place + typing_error(planted, rng, place.shape))
    arm = {
        name: TrueTarget(name, HOLLOW, "reflector", arm_typed[i], pose.arm(place[i]))
        for i, name in enumerate(FEED_ARM_RANGERS)
    }
    aim_mm = typed_mm(AIM_POINT_DESIGN + typing_error(planted, rng))
    dish = dish_prisms(dish_count, pose, streams, planted=planted)
    units = [triplet(i + 1, triplet_count, pose, streams=streams, planted=planted) for i in range(triplet_count)]
    fixed, design = structural_targets(pose, streams, planted)
    design |= {f"{t.name}-B": pose.nominal(t.design) for t in units}
    dish, fixed, units, wrong = mistype(dish, fixed, units, wrong_mm=faults.wrong_position_mm, streams=streams)
    return Structure(
        feed_arm=arm,
        dish=dish,
        triplets=units,
        structural=fixed,
        aim_point_mm=aim_mm,
        design=design,
        wrongly_typed=wrong,
    )


def structural_targets(pose: TruePosture, streams: Streams, planted: Planted):
    """Hollow cubes on feed arm and elevation bearing, with ground design points."""
    rng = streams("structural")
    targets, design = [], {}
    for name, at in STRUCTURAL_REFLECTOR.items():
        design[name] = pose.nominal(np.array(at))
        typed = typed_mm(np.array(at) + typing_error(planted, rng))
        targets.append(TrueTarget(name, HOLLOW, "reflector", typed, pose.arm(np.array(at))))
    for name, at in STRUCTURAL_ALIDADE.items():
        design[name] = pose.alidade(np.array(at))
        point = design[name] + planted.gain("posture") * rng.normal(0.0, 2.0, 3) * MILLIMETRE
        typed = typed_mm(design[name] + typing_error(planted, rng))
        targets.append(TrueTarget(name, HOLLOW, "ground", typed, point))
    return targets, design


def mistype(dish, fixed, units, *, wrong_mm: float, streams: Streams):
    """Add a gross error to one typed position; return its name.

    Of a dish prism, structural target or triplet.
    """
    rng = streams("wrong position")
    draw, direction = rng.uniform(), unit(rng.normal(size=3))
    sheets = [*dish, *fixed, *units]
    if wrong_mm == 0.0:
        return dish, fixed, units, None
    k = int(draw * len(sheets))
    sheets[k] = replace(sheets[k], position_mm=np.round(sheets[k].position_mm + wrong_mm * direction, 1))
    a, b = len(dish), len(dish) + len(fixed)
    return sheets[:a], sheets[a:b], sheets[b:], sheets[k].name
