"""True rangers of a living site: mounts, mirrors, heads; beam directions.

The laser comes down the azimuth axis and is reflected by a mirror with encoders on both axes: here the beam is
found by reflecting a ray in the mirror's face, not by the notes' angles.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import MILLIMETRE, TWO_PI
from catseye.errors import InputError
from catseye.records.site.folder import SiteFolder
from catseye.records.site.mirror import Mirror
from catseye.records.site.target import FeedArmRanger
from catseye.simulator.night.faults import Planted
from catseye.simulator.night.structure import unit
from catseye.simulator.night.world import kelvin_from_ground
from catseye.simulator.twin.targets import Drawing
from catseye.simulator.twin.telescope import turning

COUNTS_PER_TURN = 100_000.0
U_MOUNT, U_ZERO = 30e-6, 0.3  # rad, counts: of orientation and encoder zeros without a sheet value; chosen
SINK, SWAY, LEAN = 2e-6 / 3600.0, 15e-6, 5e-6  # m/s, one sigma; m and rad through a day: how monuments settle, chosen


class BeamAtMirror(NamedTuple):
    """Beam in mirror axes at k settings.

    Its origin on the face (k, 3), m; its direction (k, 3); the path (k,), m, from the plane across the azimuth axis
    through the scan point to the face, below zero where the face comes first.
    """

    leaves: Array
    direction: Array
    path: Array


@dataclass(frozen=True, eq=False)
class TrueStation:
    """True values of a ranger.

    body            of its mount: "ground" or "arm"
    place           (3,) m: Kelvin fixed point on the ground, scan point on the arm, in the body's frame
    gamma, lambda_  (3, 3) body to mount axes, mount to mirror axes
    offset          (3,) m, mount axes: fixed point to scan point (ground)
    zeros           (2,) counts
    axes            (4,) m: axis, face, beam x, beam y offsets; tilts (3,) rad: of the face, of the beam (x, y)
    waves           (2, 2, n) counts: azimuth and elevation encoder, cosines and sines by order
    d0, leakage     m, V
    zrg             (2,) counts towards the internal cube
    amplitude_to_phase   rad a factor e above the reference's amplitude
    second_pass     1/V, share of light that the detector sends out again, for each volt of return, turned by its path
    feedback        rad, of one shot's phase by light back into the laser
    image           of a shot on the detector, over the disc's radius: mean place, and scatter of each coordinate
    lag             rad, of the disc's centre behind its rim
    cyclic          (2, n) m of range error: cosines and sines, orders of the phase after the electronics'
    sinks, sways, leans   (3,) m/s; (3,) m; (3,) rad: how the monument settles
    """

    name: str
    body: str
    place: Array
    gamma: Array
    lambda_: Array
    offset: Array
    zeros: Array
    axes: Array
    tilts: Array
    waves: Array
    d0: float
    leakage: complex
    zrg: Array
    amplitude_to_phase: float
    second_pass: complex
    feedback: float
    image: tuple[float, float]
    lag: float
    cyclic: Array
    sinks: Array
    sways: Array
    leans: Array

    def settled(self, seconds: Array) -> tuple[Array, Array]:
        """Place (k, 3), m, and rotation (k, 3), rad, of the settled monument.

        At times (k,).
        """
        day = seconds[:, None] * (TWO_PI / 86_400.0)
        return self.place + self.sinks * seconds[:, None] + self.sways * np.sin(day), self.leans * np.sin(day)

    def ray(self, counts: ArrayLike) -> BeamAtMirror:
        """Beam at encoder readings (k, 2)."""
        turns = (np.asarray(counts, dtype=float) - self.zeros) * (TWO_PI / COUNTS_PER_TURN)
        read = turns
        for _ in range(8 if self.waves.any() else 0):  # an encoder's error changes by 1e-3 of itself each time
            turns = read - self._high(turns) * (TWO_PI / COUNTS_PER_TURN)
        # Rest: the face looks up the azimuth axis z, the elevation axis lies along y. It tips about y, all about z.
        (about_z, about_y), (lean, beam_x, beam_y) = turns.T, self.tilts
        cosine, sine, high = np.cos(about_z), np.sin(about_z), np.cos(lean) * np.sin(about_y)
        face = np.empty((len(turns), 3))
        face[:, 0], face[:, 1] = high * cosine - np.sin(lean) * sine, high * sine + np.sin(lean) * cosine
        face[:, 2] = np.cos(lean) * np.cos(about_y)
        axis_offset, face_offset, start_x, start_y = self.axes
        out = axis_offset * (face[:, 0] * cosine + face[:, 1] * sine)  # of the elevation axis along the face's normal
        laser = -np.array([beam_x, beam_y, np.sqrt(1.0 - beam_x**2 - beam_y**2)])
        start, against = np.array([start_x, start_y, 0.0]), face @ laser
        with np.errstate(divide="ignore", invalid="ignore"):
            path = (out + face_offset - face @ start) / against
            leaves = start + path[:, None] * laser
            return BeamAtMirror(leaves, laser - 2.0 * against[:, None] * face, path)

    def _high(self, turns: Array) -> Array:
        """Encoder errors (k, 2), counts, positive too high, at axis angles (k, 2), rad."""
        angle = turns[:, :, None] * np.arange(1, self.waves.shape[2] + 1)
        return np.sum(np.cos(angle) * self.waves[:, 0] + np.sin(angle) * self.waves[:, 1], axis=-1)

    def counts(self, target: Array) -> Array:
        """Encoder readings (k, 2), not rounded, with the beam on points (k, 3).

        Points in m, mirror axes.

        The direct pointing, azimuths -pi/2 to 3 pi/2. With offsets or tilts it aims off the point by its miss.
        """
        unit_target = unit(target)
        toward, perfect = unit_target, not (self.axes.any() or self.tilts.any())
        for rounds in range(1 if perfect else 12, 0, -1):
            azimuth = np.arctan2(toward[:, 1], toward[:, 0])
            azimuth = np.where(azimuth < -0.5 * np.pi, azimuth + TWO_PI, azimuth)
            half = 0.5 * np.arctan2(np.hypot(toward[:, 0], toward[:, 1]), toward[:, 2])
            turns = np.column_stack([azimuth, half])
            read = turns * (COUNTS_PER_TURN / TWO_PI) + self.zeros
            if self.waves.any():
                read = read + self._high(turns)
            if rounds > 1:
                ray = self.ray(read)
                toward = unit(toward + unit(target - ray.leaves) - ray.direction)
        return read


def reference_cube(station: TrueStation) -> tuple[Array, float]:
    """Place of the internal cube (3,), m, mirror axes, and path to it, m.

    In the middle of its beam, D0 from the scan point.
    """
    ray = station.ray(station.zrg[None])
    leaves, direction, path = ray.leaves[0], ray.direction[0], float(ray.path[0])
    along = leaves @ direction
    length = -along + np.sqrt(along**2 - leaves @ leaves + station.d0**2)
    return leaves + length * direction, path + float(length)


def stations(site: SiteFolder, draw: Drawing) -> dict[str, TrueStation]:
    """All rangers of a site, by name, sorted."""
    drawn = {}
    arm = {ranger.name: ranger for ranger in site.feedarm.ranger}
    for name in draw.planted.d0_error_mm:
        if name not in site.rangers:
            raise InputError(
                f"a D0 error planted on {name!r}: expected a ranger of the site, such as {site.rangers[0]}"
            )
    for name in site.rangers:
        rng, mirror = draw.streams(f"ranger/{name}"), site.mirror_of(name)
        turn, settle = rng.normal(size=3), rng.normal(size=(3, 3)) * [[0.4, 0.4, 1.0], [1.0, 1.0, 0.3], [1.0, 1.0, 0.0]]
        gain = draw.planted.gain("calibration")
        if name in arm:
            body, place, settle = "arm", np.array(arm[name].nominal_scan_point_mm) * MILLIMETRE, 0.0 * settle
            place = place + draw.typed(draw.streams(f"place/{name}"), arm[name].u_position_mm)
            gamma, u_turn = arm_mount(arm[name], site), np.full(3, U_MOUNT)
        else:
            m = site.monuments[name]
            u = np.array([m.u_x_mm, m.u_y_mm, m.u_z_mm]) * draw.streams(f"place/{name}").normal(size=3)
            body, place = "ground", (np.array([m.x_mm, m.y_mm, m.z_mm]) + gain * u) * MILLIMETRE
            gamma = kelvin_from_ground(np.array([m.alpha1_rad, m.alpha2_rad, m.alpha3_rad]))
            # alpha1 turns about the mount's y, alpha2 about z, alpha3 about x
            u_turn = np.array([U_MOUNT if v is None else v for v in (m.u_alpha3_rad, m.u_alpha1_rad, m.u_alpha2_rad)])
        settle = draw.planted.gain("settling") * settle * np.array([[SINK], [SWAY], [LEAN]])
        drawn[name] = _station(
            name,
            mirror,
            rng,
            draw.planted,
            body=body,
            place=place,
            gamma=turning(gain * u_turn * turn) @ gamma,
            settle=settle,
        )
    return drawn


def _station(
    name: str,
    mirror: Mirror,
    rng: np.random.Generator,
    planted: Planted,
    *,
    body: str,
    place: Array,
    gamma: Array,
    settle: Array,
) -> TrueStation:
    """Head and mirror of a ranger, by its sheet and uncertainties."""
    gain = planted.gain("calibration")

    def true(values: ArrayLike, u: float | None, factor: float = 1.0) -> Array:
        sheet = np.asarray(values, dtype=float)
        return (sheet + gain * (u or 0.0) * rng.normal(size=sheet.shape)) * factor

    leakage = mirror.leakage_amplitude_volt * np.exp(1j * mirror.leakage_phase_rad)
    leakage += complex(*true(np.zeros(2), mirror.u_leakage_volt))
    d0 = float(true(mirror.d0_mm, mirror.u_d0_mm)) + planted.d0_error_mm.get(name, 0.0)
    beta = true([mirror.beta1_rad, mirror.beta2_rad], mirror.u_beta_rad)
    axes = [mirror.axis_offset_mm, mirror.mirror_offset_mm, mirror.beam_x_mm, mirror.beam_y_mm]
    tilts = [mirror.face_tilt_rad, mirror.beam_tilt_x_rad, mirror.beam_tilt_y_rad]
    offset = true([mirror.dx_mm, mirror.dy_mm, mirror.dz_mm], mirror.u_offset_mm, MILLIMETRE)
    sinks, sways, leans = settle
    return TrueStation(
        name=name,
        body=body,
        place=place,
        gamma=gamma,
        lambda_=turning(np.array([-beta[0], 0.0, 0.0])) @ turning(np.array([0.0, -beta[1], 0.0])),
        offset=planted.gain("mirror_offset") * offset,
        zeros=true([mirror.na0, mirror.ne0], U_ZERO if mirror.u_zero_counts is None else mirror.u_zero_counts),
        axes=true(axes, mirror.u_axis_mm, MILLIMETRE),
        tilts=true(tilts, mirror.u_tilt_rad),
        waves=true(_waves(mirror), mirror.u_encoder_counts),
        d0=d0 * MILLIMETRE,
        leakage=planted.gain("leakage") * leakage,
        zrg=np.array([mirror.azm_zrg, mirror.elv_zrg], dtype=float),
        amplitude_to_phase=float(true(mirror.amplitude_to_phase_rad, mirror.u_amplitude_to_phase_rad)),
        feedback=mirror.u_feedback_rad or 0.0,
        image=_image(mirror),
        lag=mirror.detector_lag_rad,
        cyclic=true(_cyclic(mirror), mirror.u_cyclic_mm, MILLIMETRE),
        second_pass=complex(*true(_second_pass(mirror), mirror.u_second_pass_per_volt)),
        sinks=sinks,
        sways=sways,
        leans=leans,
    )


def _waves(mirror: Mirror) -> Array:
    """Encoder waves (2, 2, n), counts: cosines and sines by order."""
    parts = (
        (mirror.azimuth_encoder_cosine_counts, mirror.azimuth_encoder_sine_counts),
        (mirror.elevation_encoder_cosine_counts, mirror.elevation_encoder_sine_counts),
    )
    waves = np.zeros((2, 2, max(len(parts[0][0]), len(parts[1][0]))))
    for axis, pair in enumerate(parts):
        for k, values in enumerate(pair):
            waves[axis, k, : len(values)] = values
    return waves


def _cyclic(mirror: Mirror) -> Array:
    """Cyclic terms (2, n), mm; an uncertainty alone means orders 1 and 2."""
    orders = len(mirror.cyclic_cosine_mm) or (2 if mirror.u_cyclic_mm is not None else 0)
    waves = np.zeros((2, orders))
    if mirror.cyclic_cosine_mm:
        waves[:] = mirror.cyclic_cosine_mm, mirror.cyclic_sine_mm
    return waves


def _second_pass(mirror: Mirror) -> tuple[float, ...]:
    """Real and imaginary part, 1/V, of the second pass; nothing where the sheet has no uncertainty of it."""
    if mirror.u_second_pass_per_volt is None:
        return ()
    return -mirror.second_pass_sine_per_volt, mirror.second_pass_cosine_per_volt


def _image(mirror: Mirror) -> tuple[float, float]:
    """Mean place and scatter of images, over the disc's radius; nothing where the sheet has no detector."""
    if mirror.u_image_um is None or mirror.detector_radius_mm is None:
        return 0.0, 0.0
    radius = mirror.detector_radius_mm * 1e3
    return mirror.image_offset_um / radius, mirror.u_image_um / radius


def arm_mount(ranger: FeedArmRanger, site: SiteFolder) -> Array:
    """Reflector to mount axes (3, 3) of a feed-arm ranger.

    Without a value in feedarm.toml, as `ranger.initialisation` chooses: y^ from the scan point to the middle of the
    dish's surface, z^ along the reflector's x as far as it can.
    """
    if ranger.mount_z is not None and ranger.mount_y is not None:
        z = unit(np.array(ranger.mount_z))
        y = unit(np.array(ranger.mount_y) - np.array(ranger.mount_y) @ z * z)
    else:
        p = site.site.paraboloid
        x, out = p.aperture_centre_mm
        middle = np.array([x, out, (x**2 + out**2) / (4.0 * p.focal_length_mm)])
        y = unit(middle - np.array(ranger.nominal_scan_point_mm))
        z = unit(np.array([1.0, 0.0, 0.0]) - y[0] * y)
    return np.stack([np.cross(y, z), y, z])
