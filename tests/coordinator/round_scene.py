"""The bundled site as a planner and a guard are told it, and a walk along their moves that shares nothing with them.

The walk: each mirror's chain of turns by scipy from the files' numbers, the telescope's axes by cross products, the
Sun by astropy, the axes' profiles by integrating their speeds, boxes by slabs.
"""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from catseye.coordinator.parts import SiteState
from catseye.coordinator.visibility.vantage import retros_of, vantages_of
from catseye.ranger.initialisation import mount_from_reflector
from catseye.records.files.reading import read_record
from catseye.records.night.live import TICK_SECONDS, LivePosture
from catseye.records.site.folder import read_site
from catseye.records.site.keep_out import KeepOut
from repository import ROOT

DAY = 100_000_000
MORNING = 5_288_965_000_000  # 2003-09-07, 15:36 UTC: the Sun 50 degrees high in the south-east
NIGHT = 5_288_920_000_000
DEGREE = np.pi / 180
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # mount axes begin as east, up, south


@cache
def gbt():
    return read_site(ROOT / "examples" / "sites" / "gbt")


@cache
def few_prisms():
    """The same with 45 of its 2209 prisms on the dish: a planner finds how far each is seen before it begins."""
    dish = [name for name in gbt().targets if name.startswith("DP")]
    left_out = set(dish) - set(dish[::50])
    return replace(gbt(), targets={n: t for n, t in gbt().targets.items() if n not in left_out})


@cache
def stands():
    return vantages_of(gbt())


@cache
def targets():
    return retros_of(gbt())


@cache
def keep_out():
    """The example's boxes."""
    return read_record(ROOT / "examples" / "keep-out.toml", KeepOut)


def posture(ticks=MORNING, azimuth_deg=145.3, elevation_deg=30.0, rates=(0.0, 0.0)):
    return LivePosture(ticks, azimuth_deg * DEGREE, elevation_deg * DEGREE, *rates)


def placed(own):
    """`place` of a rigid telescope at the rates of a posture."""

    def place(name, mjd):
        retro = targets().get(name)
        frame, point = (
            (retro.frame, retro.point) if retro else (stands()[name].frame, stands()[name].station.scan_point)
        )
        ticks = np.atleast_1d(mjd) * DAY
        if frame == "ground":
            return np.broadcast_to(point, (len(ticks), 3))
        if frame == "reflector":
            return axes(own, ticks) @ point + vertex(own, ticks)
        turned = own.azimuth + own.azimuth_rate * (ticks - own.ticks) * TICK_SECONDS
        return Rotation.from_rotvec(-turned[:, None] * [0.0, 0.0, 1.0]).apply(point)

    return place


def state(ticks=MORNING, own=None, **changes):
    """All rangers ready, mirrors at ZRG, nothing known but the records."""
    own = own or posture(ticks)
    told = SiteState(
        now_ticks=ticks,
        posture=own,
        ready=gbt().rangers,
        counts={name: v.reference for name, v in stands().items()},
        suspended=frozenset(),
        since_reference={},
        place=placed(own),
        u={},
    )
    return replace(told, **changes)


# The walk ------------------------------------------------------------------------------------------------------------


@cache
def chain(name):
    """(3, 3) mirror coordinates of vectors in the ranger's own frame, its scan point there, na0 and ne0, stops."""
    site, mirror = gbt(), gbt().mirror_of(name)
    if name in site.monuments:
        m = site.monuments[name]
        mount = (
            Rotation.from_rotvec([-m.alpha3_rad, 0, 0])
            * Rotation.from_rotvec([0, 0, -m.alpha2_rad])
            * Rotation.from_rotvec([0, -m.alpha1_rad, 0])
        ).as_matrix() @ UPRIGHT
        at = np.array([m.x_mm, m.y_mm, m.z_mm]) + mount.T @ [mirror.dx_mm, mirror.dy_mm, mirror.dz_mm]
    else:
        mount = mount_from_reflector(site, name)
        at = np.array(next(r for r in site.feedarm.ranger if r.name == name).nominal_scan_point_mm)
    tips = Rotation.from_rotvec([-mirror.beta1_rad, 0, 0]) * Rotation.from_rotvec([0, -mirror.beta2_rad, 0])
    return tips.as_matrix() @ mount, at * 1e-3, np.array([mirror.na0, mirror.ne0], dtype=float)


def axes(own, ticks):
    """(..., 3, 3): the reflector's axes in the ground frame, one a column, z where the telescope looks."""
    since = (np.asarray(ticks, dtype=float) - own.ticks) * TICK_SECONDS
    az, el = own.azimuth + own.azimuth_rate * since, own.elevation + own.elevation_rate * since
    z = np.stack([np.sin(az) * np.cos(el), np.cos(az) * np.cos(el), np.sin(el)], axis=-1)
    x = np.stack([np.cos(az), -np.sin(az), 0.0 * az], axis=-1)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def vertex(own, ticks):
    """(..., 3) m, ground: [PARKER04] 2.43: 54.839108 m behind the elevation axis and 4.99999 m above it, turned."""
    turned = axes(own, ticks)
    return turned @ np.array([0.0, -54.839108, 4.99999]) + np.array([0.0, 0.0, 48.26])


def beams(name, counts, own, ticks):
    """Unit directions (..., 3), ground, of a beam at counts (..., 2) at times (...)."""
    turn, _, zeros = chain(name)
    theta, phi = ((counts[..., k] - zeros[k]) * 2 * np.pi / 1e5 * (1 + k) for k in (0, 1))
    u = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], axis=-1) @ turn
    if name in gbt().monuments:
        return u
    return np.einsum("...ij,...j->...i", axes(own, ticks), u)


def origin(name, own, ticks):
    """(..., 3) m, ground, of the scan point."""
    at = chain(name)[1]
    if name in gbt().monuments:
        return np.broadcast_to(at, (*np.shape(ticks), 3))
    return axes(own, ticks) @ at + vertex(own, ticks)


def walk(start, end, pace, mode, looks):
    """Counts (n, looks, 2) along moves (n, 2) to (n, 2): both axes at once, or one after the other."""
    if mode != "together":
        first = int(mode == "elevation first")
        corner = start.copy()
        corner[:, first] = end[:, first]
        return np.concatenate(
            [walk(start, corner, pace, "together", looks), walk(corner, end, pace, "together", looks)], axis=1
        )
    way = np.abs(end - start)
    v, a = np.array(pace.velocity), np.array(pace.acceleration)
    last = np.where(way > v**2 / a, way / v + v / a, 2 * np.sqrt(way / a))
    up = np.minimum(v / a, last / 2)
    even = np.linspace(0, 1, looks - 6) * np.max(last, axis=-1, keepdims=True)
    # With its corners among the looks the speed is straight between them, and trapezoids give its integral exactly.
    time = np.sort(np.concatenate([even, up, last - up, last], axis=-1), axis=-1)
    t = np.minimum(time[:, :, None], last[:, None])
    speed = np.minimum(np.minimum(a * t, v), a * (last[:, None] - t))
    steps = 0.5 * (speed[:, 1:] + speed[:, :-1]) * np.diff(t, axis=1)
    done = np.concatenate([np.zeros((len(way), 1, 2)), np.cumsum(steps, axis=1)], axis=1)
    return start[:, None] + (end - start)[:, None] * done / np.where(done[:, -1:] > 0, done[:, -1:], 1)


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def hits(points, directions):
    """Whether half-lines (..., 3) of the record's length meet one of its boxes."""
    found = np.zeros(directions.shape[:-1], dtype=bool)
    for box in keep_out().box:
        if box.low_mm is not None:
            low, high = np.array(box.low_mm) * 1e-3, np.array(box.high_mm) * 1e-3
        else:
            middle, half = np.array(box.centre_mm) * 1e-3, np.array(box.size_mm) * 0.5e-3
            low, high = middle - half, middle + half
        middle = 0.5 * (low + high)
        back = Rotation.from_euler("z", -box.turn_deg, degrees=True)
        p, d = (back.apply(v.reshape(-1, 3)).reshape(v.shape) for v in (points - middle, directions))
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (low - middle - p) / d, (high - middle - p) / d
        enter, leave = np.max(np.fmin(one, other), axis=-1), np.min(np.fmax(one, other), axis=-1)
        found |= (enter <= leave) & (leave >= 0) & (enter <= keep_out().beam_length_m)
    return found
