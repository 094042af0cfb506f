"""Simulated triplet unit on surface plate and laboratory range, by ray tracing.

Nothing of the reduction is used. A unit is a list of points and directions on its plate. It is set against stops that
are turned against the beam, turned over about the long axis of its plate, and set there again; each path is the ray
from the scan point to the corner (or to the ball's centre) that Fermat's principle picks, and its delay.

Axes of the unit: x from the left prism to the right, y up, z out of the plate on the prism side, origin in the
synthetic reference plane. Axes of the laboratory: x right, y up (gravity), z from the stops towards the ranger.
"""

from dataclasses import dataclass, fields

import numpy as np

from catseye.aliases import Array

LIGHT = 299_792_458.0  # m/s
INCH = 0.0254
POST = 3.5 * INCH  # the fixture's half-length
PHASE_TO_GROUP = 1.511186 / 1.527463  # of old BK 7 at 0.780 um


@dataclass(frozen=True, eq=False)
class TripletScenes:
    """True units and places on the range, (m,) each; metres, radians.

    height_1, height_2        of the prisms, face to corner
    radius_1, radius_2        of the ball: small sphere, silvered sphere
    fiducial_1, fiducial_2    of the prisms' reference points above the synthetic plane: -paint, and how they were made
    ball                      of the ball's centre above the synthetic plane
    spacing                   between the prisms' reference points
    ball_x, ball_y            of the ball's centre from their mid-point, along and up with the prisms to the ranger
    lean_1, lean_2 (m, 2)     tilts of the prisms in their cups, about x and y
    depth                     scan point to the synthetic plane along the stops' normal
    aside, above              scan point from the stops' middle as the beam meets it, horizontally and up
    yaw, pitch                of the stops against the beam
    roll, roll_fp             of the unit in the stops' plane, before and after the flip
    eta, eta_fp               group index of the air
    ratio                     group index of the glass over that of the air
    phi_zrg, phi_cal, phi_zrg_fp   phases of reference and calibration
    frequency                 of the modulation, Hz
    """

    height_1: Array
    height_2: Array
    radius_1: Array
    radius_2: Array
    fiducial_1: Array
    fiducial_2: Array
    ball: Array
    spacing: Array
    ball_x: Array
    ball_y: Array
    lean_1: Array
    lean_2: Array
    depth: Array
    aside: Array
    above: Array
    yaw: Array
    pitch: Array
    roll: Array
    roll_fp: Array
    eta: Array
    eta_fp: Array
    ratio: Array
    phi_zrg: Array
    phi_cal: Array
    phi_zrg_fp: Array
    frequency: Array

    @property
    def h_corr(self) -> Array:
        """True h_corr: ball's centre above the reference points' mid-point.

        Along the plate's normal.
        """
        return self.ball - 0.5 * (self.fiducial_1 + self.fiducial_2)

    def part(self, rows: slice) -> "TripletScenes":
        return TripletScenes(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})


@dataclass(frozen=True, eq=False)
class TripletSheets:
    """Laboratory data sheet without noise, (m,) each; metres, radians.

    Names as on the sheet.

    phi_1, phi_2, phi_bcfp     phases in [0, 2 pi)
    l_1, l_2, l_bt             heights on the surface plate of the prisms' faces and the ball's vertex
    hrp_1, hrp_2, pc_1, pc_2, pc_b   constants of the glass
    d_toppl, h_s               depth of the synthetic plane; where a level beam lands above the prisms' line
    d_12                       between the prisms
    """

    phi_1: Array
    phi_2: Array
    phi_bcfp: Array
    l_1: Array
    l_2: Array
    l_bt: Array
    hrp_1: Array
    hrp_2: Array
    pc_1: Array
    pc_2: Array
    pc_b: Array
    d_toppl: Array
    h_s: Array
    d_12: Array


def random_scenes(rng: np.random.Generator, cases: int, *, tilt: float = 1.5e-3, offset: float = 0.05) -> TripletScenes:
    """Random units with paint, and random places on the range.

    tilt     rad, standard deviation of the stops against the beam
    offset   m, of the scan point across the beam
    """
    m = cases
    paint = rng.uniform(0.05e-3, 0.15e-3, m)
    deviations = rng.normal(0.0, 0.1e-3, (3, m))
    height = rng.uniform(37.85e-3, 38.35e-3, (2, m)) + 0.25e-3
    eta = 1.0 + rng.uniform(235e-6, 275e-6, m)
    turn = rng.uniform(0.0, 2.0 * np.pi, (3, m))
    lean = rng.normal(0.0, 1e-3, (2, m, 2))
    across = rng.normal(0.0, offset, (2, m))
    angle = rng.normal(0.0, tilt, (4, m))
    return TripletScenes(
        height_1=height[0], height_2=height[1],
        radius_1=1.969 * INCH + rng.normal(0.0, 5e-6, m), radius_2=3.799 * INCH + rng.normal(0.0, 5e-6, m),
        fiducial_1=deviations[0] - paint, fiducial_2=deviations[1] - paint, ball=deviations[2] - paint,
        spacing=0.635 + rng.uniform(-0.15e-3, 0.15e-3, m), ball_x=np.zeros(m), ball_y=np.zeros(m),
        lean_1=lean[0], lean_2=lean[1],
        depth=rng.uniform(17.9, 18.3, m), aside=across[0], above=across[1],
        yaw=angle[0], pitch=angle[1], roll=angle[2], roll_fp=angle[3],
        eta=eta, eta_fp=eta + rng.normal(0.0, 0.3e-6, m), ratio=np.full(m, 1.527077),
        phi_zrg=turn[0], phi_cal=turn[1], phi_zrg_fp=turn[2], frequency=np.full(m, 1500e6),
    )  # fmt: skip


def triplet_sheets(scene: TripletScenes) -> TripletSheets:
    """Data sheet of each case: plate, constants, and three phases."""
    scan = _scan_point(scene)
    optical = []
    for side, sign in ((1, -0.5), (2, 0.5)):
        height, fiducial = getattr(scene, f"height_{side}"), getattr(scene, f"fiducial_{side}")
        normal = _leaning(getattr(scene, f"lean_{side}"))
        along = sign * _projected(scene)
        point = np.stack([along, np.zeros_like(along), fiducial], axis=-1)
        corner = point - ((1.0 - 1.0 / scene.ratio) * height)[:, None] * normal
        corner, normal = _placed(corner, scene.roll), _placed(normal, scene.roll)
        optical.append(_into_prism(scan, corner, normal, height, scene.eta, scene.ratio))
    centre = _placed(_turned_over(np.stack([scene.ball_x, scene.ball_y, scene.ball], axis=-1)), scene.roll_fp)
    air = np.linalg.norm(scan - centre, axis=-1) - scene.radius_1
    optical.append(scene.eta_fp * (air + scene.ratio * (scene.radius_1 + scene.radius_2)))
    zero, zero_fp = scene.phi_zrg + scene.phi_cal, scene.phi_zrg_fp + scene.phi_cal
    cycle = 0.5 * LIGHT / scene.frequency
    phases = [
        np.mod(start - 2.0 * np.pi * path / cycle, 2.0 * np.pi)
        for start, path in zip((zero, zero, zero_fp), optical, strict=True)
    ]
    n = scene.ratio
    face = [getattr(scene, f"fiducial_{k}") + getattr(scene, f"height_{k}") / n for k in (1, 2)]
    return TripletSheets(
        phi_1=phases[0], phi_2=phases[1], phi_bcfp=phases[2],
        l_1=POST + face[0], l_2=POST + face[1], l_bt=POST + scene.ball - scene.radius_1,
        hrp_1=scene.height_1 / n, hrp_2=scene.height_2 / n,
        pc_1=scene.height_1 / n - n * scene.height_1, pc_2=scene.height_2 / n - n * scene.height_2,
        pc_b=scene.radius_1 - n * (scene.radius_1 + scene.radius_2),
        d_toppl=scan[:, 2].copy(), h_s=scene.above.copy(), d_12=scene.spacing.copy(),
    )  # fmt: skip


def _projected(scene: TripletScenes) -> Array:
    """Spacing of the prisms as seen along the plate's normal."""
    rise = scene.fiducial_2 - scene.fiducial_1
    return np.sqrt(scene.spacing**2 - rise**2)


def _leaning(lean: Array) -> Array:
    """Unit normals (m, 3) tilted from z by two small angles about x and y."""
    out = np.stack([np.sin(lean[:, 1]), -np.sin(lean[:, 0]), np.ones(len(lean))], axis=-1)
    return out / np.linalg.norm(out, axis=-1, keepdims=True)


def _turned_over(point: Array) -> Array:
    """Rotate half a turn about the unit's x."""
    return point * np.array([1.0, -1.0, -1.0])


def _placed(point: Array, roll: Array) -> Array:
    """Points of the unit in the axes of the stops, the unit rolled in their plane."""
    c, s = np.cos(roll), np.sin(roll)
    x, y, z = np.moveaxis(point, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def _scan_point(scene: TripletScenes) -> Array:
    """Scan point (m, 3) in the axes of the stops.

    From the stops' middle, a level beam, and two rotations.
    """
    # in the laboratory the beam runs along -z and meets the stops' plane at (aside, above), `depth` from the ranger
    beam = np.stack([np.zeros_like(scene.yaw), np.zeros_like(scene.yaw), scene.depth], axis=-1)
    cy, sy, cp, sp = np.cos(scene.yaw), np.sin(scene.yaw), np.cos(scene.pitch), np.sin(scene.pitch)
    zero, one = np.zeros_like(cy), np.ones_like(cy)
    about_y = np.array([[cy, zero, sy], [zero, one, zero], [-sy, zero, cy]])
    about_x = np.array([[one, zero, zero], [zero, cp, -sp], [zero, sp, cp]])
    stops_from_lab = np.einsum("ijm,jkm->mik", about_x, about_y)
    turned = np.einsum("mij,mj->mi", stops_from_lab, beam)
    return turned + np.stack([scene.aside, scene.above, zero], axis=-1)


def _into_prism(scan: Array, corner: Array, normal: Array, height: Array, eta: Array, ratio: Array) -> Array:
    """Optical length (m,) from the scan point through the face to the corner.

    It bends by the phase indices (the crossing of the face makes the phase path stationary: Newton's iterations on a
    convex function) and is delayed by the group indices. The return is the same ray.
    """
    to_scan = scan - corner
    out = np.sum(to_scan * normal, axis=-1) - height
    aside = np.sqrt(np.sum(to_scan**2, axis=-1) - (out + height) ** 2)
    bend = ratio * PHASE_TO_GROUP
    crossing = aside * height / (height + bend * out)  # from the corner's foot on the face
    for _ in range(6):
        glass, air = np.hypot(height, crossing), np.hypot(out, aside - crossing)
        slope = bend * crossing / glass - (aside - crossing) / air
        curve = bend * height**2 / glass**3 + out**2 / air**3
        crossing = crossing - slope / curve
    glass, air = np.hypot(height, crossing), np.hypot(out, aside - crossing)
    return eta * (air + ratio * glass)
