"""Telescope in motion: places and bending of its bodies in time.

    ground <- (bearing tilt) <- alidade <- (elevation) <- dish <- feed arm

Points rest in the frame of their body: "ground", "alidade", "dish" and "arm", both in the reflector frame. The nominal
posture is [PARKER04] eq. 2.44, deliberately written here a second time; departures from it are drawn, their sizes
chosen: millimetres and arc seconds as the generator of nights has them, a centimetre of sag at the arm's tip over the
sky.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from catseye.aliases import Array
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.records.site.folder import SiteFolder
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.structure.bent_telescope import BentTelescope
from catseye.simulator.twin.air import LivingAir
from catseye.simulator.twin.motion import HIGHEST_DEG, LOWEST_DEG, AxisAngles, AxisMotion
from catseye.simulator.twin.waves import Waves, band, joined

ARM_FOOT, ARM_LENGTH = np.array([0.0, -8.0, 10.0]), 55.0  # m, reflector frame; chosen, as `simulator.night.posture`
GRAVITY_DISH = 0.6 * MILLIMETRE  # rms of the surface's low orders for a unit of sine or cosine of elevation
GRAVITY_SHIFT = 2.0 * MILLIMETRE
GRAVITY_SAG = 12.0 * MILLIMETRE  # of the arm's tip for a unit of cosine of elevation, along gravity
STEEL_RISE, STEEL_SHIFT, STEEL_DISH = 0.3e-3, 0.3e-3, 0.05e-3  # m/°C: elevation axis, arm's tip, low orders
WIND_TIP = 0.3 * MILLIMETRE  # rms of the arm's tip in each direction at 5 m/s; grows with the square
MODES_HZ, MODE_TIP = (0.8, 1.2, 2.4), 50e-6  # of the arm; m, mean amplitude at the tip, drawn between 0.4 and 2 of it
TILT, ENCODER = 4.0 * ARCSECOND, 2.0 * ARCSECOND
ENCODER_ORDERS = np.array([1.0, 2.0, 16.0])


def turning(vector: Array) -> Array:
    """Matrices (..., 3, 3) of rotation vectors (..., 3), rad: Rodrigues' formula."""
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    angle = np.sqrt(x * x + y * y + z * z)
    safe = np.where(angle > 0.0, angle, 1.0)
    first = np.where(angle > 0.0, np.sin(angle) / safe, 1.0)
    second = np.where(angle > 0.0, 2.0 * (np.sin(0.5 * angle) / safe) ** 2, 0.5)
    matrices = np.empty((*angle.shape, 3, 3))
    for i, j, k, u, v, w in ((0, 1, 2, x, y, z), (1, 2, 0, y, z, x), (2, 0, 1, z, x, y)):
        matrices[..., i, i] = 1.0 - second * (v * v + w * w)
        matrices[..., i, j] = second * u * v - first * w
        matrices[..., i, k] = second * u * w + first * v
    return matrices


def low_orders(xy: Array, centre: Array, radius: float) -> Array:
    """Six smooth shapes (n, 6) of the aperture, rms 1, at (n, 2), m."""
    x, y = ((xy - centre) / radius).T
    r2 = x**2 + y**2
    shapes = (x**2 - y**2, 2 * x * y, (3 * r2 - 2) * x, (3 * r2 - 2) * y, x**3 - 3 * x * y**2, 6 * r2**2 - 6 * r2 + 1)
    return np.column_stack(shapes) * np.sqrt([6.0, 6.0, 8.0, 8.0, 8.0, 5.0])


class Body(NamedTuple):
    """Body at k times: ground = turn @ (rest + bending) + shift.

    Turn (k, 3, 3), shift (k, 3), m.
    """

    turn: Array
    shift: Array


class TelescopeState(NamedTuple):
    """State of the telescope at k times.

    orders       (k, 6) m along the normals: its surface's low orders
    scale        (k,) expansion of the telescope about the pintle bearing, applied last
    dish_scale   (k,) expansion of the dish about its middle, applied first
    """

    bodies: dict[str, Body]
    orders: Array
    scale: Array
    dish_scale: Array


@dataclass(frozen=True, eq=False)
class Telescope:
    """Telescope that moves and bends; every draw is made once.

    reflector_to_elevation, axis_height   m, from site.toml
    rest_elevation   rad: elevation at which positions on dish and arm agree with the files
    rigid_shift, rigid_turn   (3,) m, (3, 3): constant departure of the dish; turned about the elevation axis
    arm              (6,) constant shift of the tip, m, and turn about the foot, rad
    gravity          (2, 9) for sine and cosine of elevation: shift of the dish, orders
    sag              m
    steel            (10,) a °C: rise of the elevation axis, shift of the arm, orders
    sway             waves (6): shift of the arm's tip by wind and by vibration, m
    tilt             (2, 3) rad: lean of the bearing to east and north, constant, cosine and sine of twice the azimuth
    encoder          (2, 2, 3) rad: cosines and sines of both encoders' errors by `ENCODER_ORDERS`
    expansion        (2,) a °C of the steel: the full telescope, and the additional expansion of the dish
    bent             structural model in place of gravity's and the steel's rigid motions; None: these are drawn
    """

    motion: AxisMotion
    latitude: float
    start_mjd: float
    air: LivingAir
    reflector_to_elevation: Array
    axis_height: float
    rest_elevation: float
    rigid_shift: Array
    rigid_turn: Array
    arm: Array
    gravity: Array
    sag: float
    steel: Array
    sway: Waves
    tilt: Array
    encoder: Array
    expansion: Array
    bent: BentTelescope | None = None

    def angles(self, seconds: Array) -> AxisAngles:
        """True angles of the axes at times (k,)."""
        return self.motion.angles(seconds, latitude=self.latitude, start_mjd=self.start_mjd)

    def encoder_angles(self, seconds: Array) -> AxisAngles:
        """Encoder angles at times (k,)."""
        true, encoders = self.angles(seconds), []
        for axis in (0, 1):
            wave = ENCODER_ORDERS * true[axis][:, None]
            cosine, sine = self.encoder[:, axis]
            error = np.cos(wave) @ cosine + np.sin(wave) @ sine
            slope = np.cos(wave) @ (ENCODER_ORDERS * sine) - np.sin(wave) @ (ENCODER_ORDERS * cosine)
            encoders.append((true[axis] + error, true[axis + 2] * (1.0 + slope)))
        return AxisAngles(encoders[0][0], encoders[1][0], encoders[0][1], encoders[1][1])

    def standing(self, seconds: Array) -> TelescopeState:
        """State of all bodies at times (k,), s since the start."""
        a, e, _, _ = self.angles(seconds)
        steel = self.air.steel_c(seconds)[:, None]
        pull = np.column_stack([np.sin(e) - np.sin(self.rest_elevation), np.cos(e) - np.cos(self.rest_elevation)])
        bent, warm, sway = pull @ self.gravity, steel * self.steel, self.sway(seconds)

        alidade = self._leaning(a) @ _azimuth(a)
        axis = np.zeros((len(seconds), 3))
        axis[:, 2] = self.axis_height + warm[:, 0]
        dish = alidade @ _elevation(e) @ self.rigid_turn
        away = self.reflector_to_elevation + self.rigid_shift + bent[:, :3]
        dish_shift = _moved(dish, away) + _moved(alidade, axis)

        tip = self.arm[:3] + warm[:, 1:4] + sway[:, :3] + sway[:, 3:]
        tip[:, 1] += self.sag * pull[:, 1]  # with the elevation falling, gravity pulls the arm towards the dish
        turn = np.zeros_like(tip)
        turn[:, 0], turn[:, 1] = -tip[:, 1] / ARM_LENGTH, tip[:, 0] / ARM_LENGTH  # tip = turn x (0, 0, length)
        along = np.zeros_like(tip)
        along[:, 2] = tip[:, 2]
        bend = turning(turn + self.arm[3:])
        arm_shift = _moved(dish, ARM_FOOT + along - _moved(bend, ARM_FOOT)) + dish_shift
        bodies = {
            "ground": Body(np.broadcast_to(np.eye(3), dish.shape), np.zeros_like(axis)),
            "alidade": Body(alidade, np.zeros_like(axis)),
            "dish": Body(dish, dish_shift),
            "arm": Body(dish @ bend, arm_shift),
        }
        if self.bent is not None:
            for name in ("alidade", "dish", "arm"):
                moved, (turn, shift) = self.bent.shift(name, a, e), bodies[name]
                bodies[name] = Body(moved.turn @ turn, _moved(moved.turn, shift) + moved.shift)
        scale = steel * self.expansion
        return TelescopeState(bodies, bent[:, 3:] + warm[:, 4:], scale[:, 0], scale[:, 1])

    def _leaning(self, azimuth: Array) -> Array:
        """Turn of the alidade (k, 3, 3) by the bearing's lean."""
        waves = np.column_stack([np.ones_like(azimuth), np.cos(2.0 * azimuth), np.sin(2.0 * azimuth)])
        lean = np.zeros((len(azimuth), 3))
        lean[:, :2] = waves @ self.tilt.T
        return turning(lean)


def telescope(
    site: SiteFolder, motion: AxisMotion, start_mjd: float, *, air: LivingAir, streams: Streams, planted: Planted
) -> Telescope:
    """Draw the telescope of a site; a structural model of the site bends it.

    Raises InputError for a model that does not hold in all postures.
    """
    bent = None if site.structure is None else BentTelescope(site.structure)
    if bent is not None:
        bent.refuse_narrow(LOWEST_DEG, HIGHEST_DEG)
    residual = np.clip(streams("living posture").normal(size=(4, 3)), -2.0, 2.0)
    rigid, arm = planted.gain("posture"), planted.gain("feed_arm")
    turn = residual[1] * np.array([18.0, 8.0, 8.0]) * ARCSECOND
    bending, steel = streams("gravity").normal(size=(2, 9)), streams("steel").normal(size=10)
    bending[:, :3] *= GRAVITY_SHIFT
    bending[:, 3:] *= GRAVITY_DISH / np.sqrt(6.0)
    steel *= np.array([0.0, *[STEEL_SHIFT] * 3, *[STEEL_DISH / np.sqrt(6.0)] * 6])
    steel[0] = STEEL_RISE
    if bent is not None:
        bending[:, :3], steel[:4] = 0.0, 0.0
    nominal = site.site.frames.reflector
    conditions, dish = air.conditions, float(streams("dish expansion").uniform(-1.0, 1.0))
    return Telescope(
        motion=motion,
        latitude=site.site.site.latitude_deg * DEGREE,
        start_mjd=start_mjd,
        air=air,
        reflector_to_elevation=np.array(nominal.reflector_to_elevation_mm) * MILLIMETRE,
        axis_height=nominal.elevation_axis_height_mm * MILLIMETRE,
        rest_elevation=site.site.campaign.elevation_deg * DEGREE,
        rigid_shift=rigid * residual[0] * 3.0 * MILLIMETRE,
        rigid_turn=turning(rigid * turn),
        arm=arm * np.concatenate([residual[2] * 4.0 * MILLIMETRE, residual[3] * 12.0 * ARCSECOND]),
        gravity=planted.gain("gravity") * bending,
        sag=0.0 if bent is not None else planted.gain("gravity") * GRAVITY_SAG,
        steel=planted.gain("thermal") * steel,
        sway=_sway(air.conditions.wind_m_s, streams, planted),
        tilt=planted.gain("bearing_tilt") * TILT * streams("bearing").normal(size=(2, 3)) * (1.0, 0.4, 0.4),
        encoder=planted.gain("encoder") * ENCODER * streams("encoders").normal(size=(2, 2, 3)) * (1.0, 0.5, 0.1),
        expansion=planted.gain("expansion")
        * conditions.expansion_per_k
        * np.array([1.0, conditions.dish_expansion * dish]),
        bent=bent,
    )


def _sway(wind_m_s: float, streams: Streams, planted: Planted) -> Waves:
    """Shift of the arm's tip (6 channels): wind, then vibration.

    Wind along x, y, z; vibration along the arm a tenth.
    """
    stiff = np.array([1.0, 1.0, 0.1])
    wind = band(streams("wind"), WIND_TIP * (wind_m_s / 5.0) ** 2, 0.1, high=0.3, channels=3).scaled(stiff)
    rng = streams("vibration")
    parts = []
    for hertz in MODES_HZ:
        size, direction = MODE_TIP * rng.uniform(0.4, 2.0), rng.normal(size=3) * stiff
        mode = band(rng, size / np.sqrt(2.0), 0.985 * hertz, high=1.015 * hertz)  # amplitude sqrt(2) times the rms
        direction /= np.linalg.norm(direction)
        parts.append(Waves(mode.omega, mode.cosine * direction, mode.sine * direction, np.zeros(3)))
    shaken = Waves(
        np.concatenate([p.omega for p in parts]),
        np.concatenate([p.cosine for p in parts]),
        np.concatenate([p.sine for p in parts]),
        np.zeros(3),
    )
    return joined(wind.scaled(planted.gain("wind")), shaken.scaled(planted.gain("vibration")))


def _moved(turn: Array, vector: Array) -> Array:
    """Vectors (k, 3) or (3,) turned by (k, 3, 3)."""
    return (turn @ np.broadcast_to(vector, (len(turn), 3))[..., None])[..., 0]


def _azimuth(angle: Array) -> Array:
    """Alidade to ground (k, 3, 3), clockwise from north.

    Source: [PARKER04] eq. 2.40.
    """
    matrices = np.zeros((len(angle), 3, 3))
    c, s = np.cos(angle), np.sin(angle)
    matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 0], matrices[:, 1, 1], matrices[:, 2, 2] = c, s, -s, c, 1.0
    return matrices


def _elevation(angle: Array) -> Array:
    """Elevation structure to alidade (k, 3, 3), parallel at the zenith.

    Source: [PARKER04] eq. 2.41.
    """
    matrices = np.zeros((len(angle), 3, 3))
    s, c = np.sin(angle), np.cos(angle)
    matrices[:, 0, 0], matrices[:, 1, 1], matrices[:, 1, 2], matrices[:, 2, 1], matrices[:, 2, 2] = 1.0, s, c, -c, s
    return matrices
