"""Predicted circle readings of directions on a Kelvin mount.

And their dependence on all inputs.

All angles here are rad, clockwise; the v-block's direction is that of the mount's z^. With the circle's reading o of
z^, taken through a transport as o + drift,

    face-free reading = (azimuth of the sight) - (azimuth of z^) + o        both about the plumb line at the monument
    reading           = that + face (collimation / sin z + trunnion cot z) + axis_lean_error    face left +1, right -1

A reference's direction from z^ is known from the lab: -v_block. Known points come from ground-frame coordinates, stars
from their place in the sky; both are turned into the plumb line's axes at the instrument.
"""

from dataclasses import dataclass, field

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE, TWO_PI
from catseye.geometry.frames.plumb import astronomic, axis_lean_error, azimuth, plumb_from_ground, zenith_angle
from catseye.geometry.mirror.mount import gamma
from catseye.geometry.sky.star import POLARIS, Star, star_place
from catseye.records.files.readings import TIME, SheetReadings
from catseye.records.files.refusal import refusal, shown
from catseye.reduction.calibrations.monument.azimuth_sheet import CataloguedStar
from catseye.reduction.calibrations.monument.frame_sheet import frame_of

BEFORE, FIELD, AFTER = "before", "field", "after"
FACES = {"left": 1.0, "right": -1.0}


@dataclass(frozen=True)
class SightConditions:
    """Inputs of the predicted readings besides azimuth and circle zeros.

    Zero is the sheet's value.

    xi, eta      rad, change of the deflection
    time         s, by which the clock is late, UT1 - UTC included
    pole         rad, change of x_p, y_p
    offset       m, change of the instrument's place in mount axes
    points       (k + 1, 3), m, change of the fixed point and the known points
    """

    xi: float = 0.0
    eta: float = 0.0
    time: float = 0.0
    pole: tuple[float, float] = (0.0, 0.0)
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    points: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class DirectionSights:
    """Rows of a table as sights.

    readings   the table, with sheet AzimuthSheet
    observed   (m,) circle reading, that of face right turned by half a turn
    face       (m,) +1 left, -1 right
    sets       names of the circle's settings; of_set (m,) their index
    kind       (m,) "reference", "point" or "star"; which (m,) its index among those of the sheet
    place      (m,) before, field or after
    share      (m,) of the transport, 0 in the lab before, 1 after
    """

    readings: SheetReadings
    observed: np.ndarray
    face: np.ndarray
    sets: tuple[str, ...]
    of_set: np.ndarray
    kind: np.ndarray
    which: np.ndarray
    place: np.ndarray
    share: np.ndarray

    def are(self, kind: str) -> np.ndarray:
        """True (m,) for sights of a kind."""
        return self.kind == kind


def sights_of(readings: SheetReadings) -> DirectionSights:
    """Sights of a table.

    InputError for an unknown target, face or place, or a star without a time.
    """
    m = len(readings)
    targets_by_name = _target_kinds(readings)
    targets = readings.words["target"]
    face_words = readings.words.get("face", ("left",) * m)
    places = readings.words.get("place", (FIELD,) * m)
    set_words = readings.words.get("set", ("1",) * m)
    for row in range(m):
        if targets[row] not in targets_by_name:
            raise readings.refuse(row, f"target = {shown(targets[row])} is not in {readings.sheet_file} (expected one "
                                       f"of {', '.join(targets_by_name)})")  # fmt: skip
        if face_words[row] not in FACES:
            raise readings.refuse(row, f"face = {shown(face_words[row])} (expected left or right)")
        if places[row] not in (BEFORE, FIELD, AFTER):
            raise readings.refuse(row, f"place = {shown(places[row])} (expected before, field or after)")
        if places[row] != FIELD and targets_by_name[targets[row]][0] != "reference":
            raise readings.refuse(row, f"target = {shown(targets[row])} is seen in the lab, {places[row]} the carriage "
                                       "(expected a reference there)")  # fmt: skip
        if targets_by_name[targets[row]][0] == "star" and TIME not in readings.numbers:
            raise refusal(readings.file, f"line 1, column {TIME!r} is missing (needed for the star {targets[row]})")
    face = np.array([FACES[word] for word in face_words])
    observed = readings.get("direction_deg") * DEGREE - np.where(face < 0.0, np.pi, 0.0)
    sets = tuple(dict.fromkeys(set_words))
    place = np.array(places)
    return DirectionSights(
        readings=readings,
        observed=observed,
        face=face,
        sets=sets,
        of_set=np.array([sets.index(word) for word in set_words]),
        kind=np.array([targets_by_name[name][0] for name in targets]),
        which=np.array([targets_by_name[name][1] for name in targets]),
        place=place,
        share=_share(readings, place, set_words),
    )


def _target_kinds(readings: SheetReadings) -> dict[str, tuple[str, int]]:
    """Name -> (kind, index) of the sheet's targets and Polaris."""
    sheet = readings.sheet
    named = [(r.name, ("reference", k)) for k, r in enumerate(sheet.reference)]
    named += [(p.name, ("point", k)) for k, p in enumerate(sheet.point)]
    named += [(s.name, ("star", k)) for k, s in enumerate(sheet.star)]
    names = [name for name, _ in named]
    for name in names:
        if names.count(name) > 1:
            raise refusal(readings.sheet_file, f"name = {shown(name)} is there {names.count(name)} times")
    return {POLARIS.name: ("star", -1), **dict(named)}


def _share(readings: SheetReadings, place: np.ndarray, sets: tuple[str, ...]) -> np.ndarray:
    """Progress of each set's transport, 0 to 1.

    By time if available, else half-way in the field.
    """
    share = np.where(place == BEFORE, 0.0, np.where(place == AFTER, 1.0, 0.5))
    if TIME not in readings.numbers:
        return share
    mjd, words, on = readings.numbers[TIME], np.array(sets), readings.active
    for name in dict.fromkeys(sets):
        ends = [on & (words == name) & (place == end) for end in (BEFORE, AFTER)]
        if not (ends[0].any() and ends[1].any()):
            continue
        start, end = (float(np.mean(mjd[rows])) for rows in ends)
        inside = (words == name) & (place == FIELD)
        if end <= start:
            raise refusal(readings.file, f"set {shown(name)} is back in the lab before it left (look at {TIME})")
        share[inside] = np.clip((mjd[inside] - start) / (end - start), 0.0, 1.0)
        outside = inside & ((mjd < start) | (mjd > end))
        if outside.any():
            raise readings.refuse(int(np.argmax(outside)), f"{TIME} = {mjd[outside][0]:.6f} is no time between the "
                                                           "readings in the lab before and after")  # fmt: skip
    return share


def geometry_of(sights: DirectionSights, azimuth_z: float, changed: SightConditions) -> tuple[np.ndarray, np.ndarray]:
    """Direction from z^ about the plumb line, and zenith angle.

    Of each sight: (m,), (m,).

    sights       the table
    azimuth_z    rad, of z^ in the ground frame
    changed        changes of the inputs
    """
    sheet, readings = sights.readings.sheet, sights.readings
    frame = frame_of(sheet, xi=changed.xi, eta=changed.eta)
    points = np.array([[sheet.x_mm, sheet.y_mm, sheet.z_mm], *([p.x_mm, p.y_mm, p.z_mm] for p in sheet.point)])
    points = points * MILLIMETRE + (0.0 if changed.points is None else changed.points)
    plumb = plumb_from_ground(frame, points[0])
    mount = gamma(np.pi - azimuth_z, sheet.alpha2_rad, sheet.alpha3_rad)
    offset = np.array([sheet.instrument_dx_mm, sheet.instrument_dy_mm, sheet.instrument_dz_mm]) * MILLIMETRE
    instrument = points[0] + mount.T @ (offset + changed.offset)
    zero = azimuth(plumb @ np.array([np.sin(azimuth_z), np.cos(azimuth_z), 0.0]))
    turned = np.zeros(len(readings))
    zenith = readings.numbers.get("zenith_deg", np.full(len(readings), 90.0)) * DEGREE
    for k, reference in enumerate(sheet.reference):
        turned[sights.are("reference") & (sights.which == k)] = -reference.v_block_deg * DEGREE
    for k in range(len(sheet.point)):
        rows = sights.are("point") & (sights.which == k)
        sight = plumb @ (points[k + 1] - instrument)
        turned[rows], zenith[rows] = azimuth(sight) - zero, zenith_angle(sight)
    if sights.are("star").any():
        latitude, longitude = astronomic(frame, points[0])
        mjd = readings.numbers[TIME]
        for k in np.unique(sights.which[sights.are("star")]):
            rows = sights.are("star") & (sights.which == k)
            at, high = star_place(
                POLARIS if k < 0 else star_of(sheet.star[k]),
                mjd[rows],
                latitude,
                longitude=longitude,
                height=float(points[0, 2]) + frame.height,
                ut1_utc=sheet.ut1_utc_s + changed.time,
                pole=(
                    sheet.pole_x_arcsec * ARCSECOND + changed.pole[0],
                    sheet.pole_y_arcsec * ARCSECOND + changed.pole[1],
                ),
            )
            turned[rows], zenith[rows] = at - zero, high
    return turned, zenith


def star_of(entry: CataloguedStar) -> Star:
    """Star of a sheet's entry, in radians and arcseconds."""
    return Star(
        name=entry.name,
        right_ascension=entry.ra_deg * DEGREE,
        declination=entry.dec_deg * DEGREE,
        motion_ra=entry.motion_ra_mas * 1e-3 * ARCSECOND,
        motion_dec=entry.motion_dec_mas * 1e-3 * ARCSECOND,
        parallax_arcsec=entry.parallax_mas * 1e-3,
        radial_velocity_km_s=entry.radial_velocity_km_s,
    )


def leaning(
    sights: DirectionSights, turned: np.ndarray, zenith: np.ndarray, *, lean_x: float, lean_z: float
) -> np.ndarray:
    """Effect of the vertical axis' lean on each field reading, rad.

    turned, zenith   (m,) from `geometry_of`
    lean_x, lean_z   rad, of the axis' top towards the mount's x^ and z^

    To the right of a sight at the angle t clockwise from z^ is t + 90°: -sin t along z^, -cos t along x^ (which lies at
    -90°, counter-clockwise of the v-block).
    """
    right = -lean_z * np.sin(turned) - lean_x * np.cos(turned)
    return np.where(sights.place == FIELD, axis_lean_error(zenith, right), 0.0)


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles reduced to [-pi, pi)."""
    return np.mod(angle + np.pi, TWO_PI) - np.pi
