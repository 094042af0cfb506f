"""Corrections of a ranger's head beyond zero and leakage.

Five effects, each only where the mirror sheet gives a value or an uncertainty for it:
axes        the mirror's axes and the beam do not meet: of target and reference cube, each at its own angles
amplitude   the phase grows with ln(amplitude); counted from the ranger's own reference shots, interpolated to the
            instant of the shot, so that the references themselves need no correction
cyclic      a wave of the phase after the electronics'
second pass light that the detector sends out again, in proportion to the return; the cube's own is part of D0
image       places of the images on a detector whose centre is late: the mean of the effect, a constant of the head
The sheet's values are applied; their errors are parameters of the ranger, shared by all its shots, with the sheet's
uncertainties as priors (u_axis_mm: the four offsets independent of each other). An image's place is another one each
shot: its effect has no parameter, but is noise of the shot, like light back into the laser (`head_noise`).

A campaign's records carry no encoder counts: a shot is taken as fired in the direct pointing, unless the mirror's
azimuth limits forbid that and allow the prime one.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE, SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.geometry.mirror.encoder import HALF_TURN, azimuth_angle, azimuth_counts, elevation_angle, within
from catseye.geometry.mirror.mirror_path import beam_angles, direction_angles, path_change
from catseye.geometry.mirror.pointing import MirrorStation
from catseye.optics.detector import ImageLead, image_lead
from catseye.records.files.refusal import refusal
from catseye.records.night.campaign import ObservedSite
from catseye.records.site.mirror import Mirror, MirrorGeometry
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.site.stations import AXES, station_in
from catseye.signal.systematics.amplitude import amplitude_by_coefficient, amplitude_phase
from catseye.signal.systematics.cyclic import cyclic_design, cyclic_range
from catseye.signal.systematics.multipath import second_pass_turn

LASER, IMAGE = "light back into the laser", "image on the detector"  # noise of each shot by itself
UNSAID_ORDERS = 2  # of a cyclic deviation for which the sheet gives only the uncertainty


@dataclass(frozen=True)
class Unknown:
    """Error of an effect's sheet values: an unknown of expectation zero.

    quantity   in the layout
    parts      of it
    u          of each, m or rad
    key        of the sheet
    """

    quantity: Parameter
    parts: tuple[str, ...]
    u: float
    key: str


@dataclass(frozen=True, eq=False)
class HeadCorrections:
    """Corrections to add to one ranger's ranges.

    value     (m,) m, by the sheet
    columns   (m, q) parameters of the sheet's errors
    slopes    (m, q) derivatives of the correction by these, metres a unit
    """

    value: np.ndarray
    columns: np.ndarray
    slopes: np.ndarray

    def at(self, x: np.ndarray) -> np.ndarray:
        """Correction (m,), m, by the sheet and the parameters x."""
        return self.value + np.sum(self.slopes * x[self.columns], axis=1)


def head_unknowns(campaign: ObservedSite, name: str) -> list[Unknown]:
    """Unknowns of a ranger's head; none without these effects.

    Raises InputError for a feed-arm ranger with axis offsets in its sheet if feedarm.toml does not give the orientation
    of its mount.
    """
    mirror = campaign.mirror_of(name)
    unknowns = []
    if mirror.u_axis_mm is not None:
        mounted(campaign, name)
        parts = tuple(key.removesuffix("_mm").replace("_", " ") for key in AXES)
        unknowns.append(Unknown(Parameter(ParameterKind.AXES, name), parts, mirror.u_axis_mm * MILLIMETRE, "u_axis_mm"))
    if mirror.u_amplitude_to_phase_rad is not None:
        u = mirror.u_amplitude_to_phase_rad
        unknowns.append(Unknown(Parameter(ParameterKind.AMPLITUDE, name), ("",), u, "u_amplitude_to_phase_rad"))
    if mirror.u_cyclic_mm is not None:
        orders = range(1, _orders(mirror) + 1)
        parts = (*(f"cosine {k}" for k in orders), *(f"sine {k}" for k in orders))
        unknowns.append(
            Unknown(Parameter(ParameterKind.CYCLIC, name), parts, mirror.u_cyclic_mm * MILLIMETRE, "u_cyclic_mm")
        )
    if mirror.u_second_pass_per_volt is not None:
        second = Parameter(ParameterKind.SECOND_PASS, name)
        unknowns.append(Unknown(second, ("cosine", "sine"), mirror.u_second_pass_per_volt, "u_second_pass_per_volt"))
    return unknowns


def radian_length(modulation_hz: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Range (m,) of a radian of phase, m, at modulation frequencies, Hz, in air of a group index."""
    return 0.5 * SPEED_OF_LIGHT / (modulation_hz * TWO_PI * index)


def head_corrections(
    campaign: ObservedSite,
    name: str,
    at: Mapping[Parameter, int],
    *,
    sight: np.ndarray,
    phase: np.ndarray,
    amplitude: np.ndarray,
    reference_amplitude: np.ndarray,
    per_radian: np.ndarray,
) -> HeadCorrections:
    """Corrections of one ranger's ranges and their derivatives.

    name                 of the ranger
    at                   first column of each quantity of the adjustment
    sight                (m, 3) m, ground frame: from the scan point to the target
    phase                (m,) rad, the target's after the electronics', as measured
    amplitude            (m,) V, of the target's return
    reference_amplitude  (m,) V, of the cube's return at that instant
    per_radian           (m,) m, from `radian_length`

    The amplitude's own noise is left out: it adds coefficient^2/2 of the phase's u, at most half a percent.

    Source: [PARKER04] section 5.3 (axes), chapter 6, items 2 (image), 3 (second pass) and 5 (amplitude), section 5.2.1
    (causes of a cyclic deviation).
    """
    mirror = campaign.mirror_of(name)
    m = len(phase)
    value, columns, slopes = np.zeros(m), [], []
    if mirror.u_image_um is not None:
        value = value + per_radian * float(image_of(mirror).mean)
    for unknown in head_unknowns(campaign, name):
        kind = unknown.quantity.kind
        if kind is ParameterKind.AXES:
            change, by = _axes(campaign, name, sight)
        elif kind is ParameterKind.AMPLITUDE:
            # A phase read too high is a range read too short.
            change = per_radian * amplitude_phase(amplitude, reference_amplitude, mirror.amplitude_to_phase_rad)
            by = per_radian[:, None] * amplitude_by_coefficient(amplitude, reference_amplitude)[:, :1]
        elif kind is ParameterKind.SECOND_PASS:
            turn, slope = second_pass_turn(
                phase, amplitude, mirror.second_pass_cosine_per_volt, mirror.second_pass_sine_per_volt
            )
            change, by = -per_radian * turn, -per_radian[:, None] * slope
        else:
            cosine, sine = (np.array(c) * MILLIMETRE for c in (mirror.cyclic_cosine_mm, mirror.cyclic_sine_mm))
            change, by = -cyclic_range(phase, cosine, sine), -cyclic_design(phase, _orders(mirror))
        value = value + change
        columns.append(np.broadcast_to(at[unknown.quantity] + np.arange(len(unknown.parts)), by.shape))
        slopes.append(by)
    no_columns = np.zeros((m, 0))
    return HeadCorrections(
        value, np.concatenate([no_columns.astype(int), *columns], 1), np.concatenate([no_columns, *slopes], 1)
    )


def image_of(mirror: MirrorGeometry) -> ImageLead:
    """Lead, rad, of a head's signals by the places of their images; zero where the sheet has none."""
    if mirror.u_image_um is None or mirror.detector_radius_mm is None:
        return ImageLead(np.zeros(()), np.zeros(()))
    radius = mirror.detector_radius_mm * MILLIMETRE
    offset, u = mirror.image_offset_um * 1e-6, mirror.u_image_um * 1e-6
    return image_lead(offset, u, lag=mirror.detector_lag_rad, radius=radius)


def head_noise(mirror: MirrorGeometry) -> dict[str, float]:
    """Standard uncertainties, rad, of one shot's phase by a head's effects that are new each shot.

    By name of the effect; only those that the sheet has.
    """
    noise = {}
    if mirror.u_feedback_rad is not None:
        noise[LASER] = mirror.u_feedback_rad
    if mirror.u_image_um is not None:
        noise[IMAGE] = float(image_of(mirror).u)
    return noise


def _orders(mirror: Mirror) -> int:
    return len(mirror.cyclic_cosine_mm) or UNSAID_ORDERS


def _axes(campaign: ObservedSite, name: str, sight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Correction (m,) and its derivatives (m, 4) by the offsets.

    By the four offsets: minus the target's change, plus the cube's.

    Source: [PARKER04] eq. 2.8 and 2.12 for the mirror's axes, 2.21 and 2.22 for the cube's angles.
    """
    station, mirror = mounted(campaign, name), campaign.mirror_of(name)
    offsets = np.array([getattr(mirror, key) for key in AXES]) * MILLIMETRE
    target = sight @ station.mirror_from_ground.T
    prime = only_prime(mirror, direction_angles(target)[0])
    theta, phi = beam_angles(target, offsets, prime=prime)
    if np.isnan(phi).any():
        raise ValidityError(
            f"{name}: a target lies straight behind its mirror, where no beam reaches it: check the typed position and "
            "the orientation of its mount"
        )
    change, slopes = path_change(theta, phi, np.linalg.norm(target, axis=-1), offsets, prime=prime)
    theta_0, phi_0 = azimuth_angle(mirror.azm_zrg, mirror.na0), elevation_angle(mirror.elv_zrg, mirror.ne0)
    if abs(phi_0) > np.pi:
        raise refusal(
            f"mirrors/{mirror.zp}.toml",
            f"elv_zrg = {mirror.elv_zrg} turns the mirror's face from the beam, {np.degrees(abs(phi_0)) / 2:.1f} "
            "degrees (expected at most 25000 counts from ne0, so that axis offsets have a meaning)",
        )
    change_0, slopes_0 = path_change(theta_0, phi_0, mirror.d0_mm * MILLIMETRE, offsets)
    return change_0 - change, slopes_0 - slopes


def mounted(campaign: ObservedSite, name: str) -> MirrorStation:
    """Mirror station of the ranger in its mount.

    InputError on the feed arm where feedarm.toml does not give the orientation.
    """
    station, mirror = station_in(campaign, name), campaign.mirror_of(name)
    if station is not None:
        return station
    sheet_key = next((key for key in AXES if getattr(mirror, key)), "u_axis_mm")
    raise refusal(
        f"mirrors/{mirror.zp}.toml",
        f"{sheet_key} = {getattr(mirror, sheet_key)} cannot be applied: {name} is on the feed arm and no record gives "
        "the orientation of its mirror (expected mount_z and mount_y in feedarm.toml, or no axis_offset_mm, "
        "mirror_offset_mm, beam_x_mm, beam_y_mm, u_axis_mm)",
    )


def only_prime(mirror: Mirror, theta: np.ndarray) -> np.ndarray:
    """True where the azimuth limits allow only the prime pointing."""

    low, high, direct = mirror.az_low_limit, mirror.az_high_limit, azimuth_counts(theta, mirror.na0)
    return ~within(direct, low, high) & (within(direct + HALF_TURN, low, high) | within(direct - HALF_TURN, low, high))
