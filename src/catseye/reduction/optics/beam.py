"""From a beam train's record to what the light does: sizes, clipping, power, and what each part does to a range.

Outward the beam is Gaussian in two planes; an aperture takes its share and the rest goes on as if whole: rings behind
an edge that takes much are not followed. From the reflector on the light is computed by diffraction, except where the
reflector clips next to nothing: then it stays the Gaussian that it was as far as the detector, which is lit by what the
tightest inward aperture let pass. Apertures in a row let through what the tightest of them does.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catseye.constants import DEGREE, MILLIMETRE, SPEED_OF_LIGHT, TWO_PI
from catseye.errors import InputError, ValidityError
from catseye.optics import abcd, coating, detector, gaussian_beam, glass, isolator, receiver
from catseye.records.site.beam import BeamElement, BeamTrain, Laser
from catseye.signal.systematics.feedback import fringe_contrast

Array = NDArray[np.float64]
WIDE = 5.0  # beam radii: what a missing aperture stands for
UNCLIPPED = 1e-5  # of the power lost: the beam then stays Gaussian, to 1e-3 of a share, 5e-3 through a pinhole
ALL_LIGHT = 30.0  # rad of diffraction beyond the rays, see `gaussian_beam.SPREADS`
HALF_MAXIMUM = math.sqrt(2.0 / math.log(2.0)) / 2.0  # full angle at half maximum to half angle at 1/e^2
MICROMETRE = 1e-6


@dataclass(frozen=True, eq=False)
class BeamPlace:
    """The beam where it meets an element.

    leg         "outward", "reflector", "inward", "detector"
    name        of the element, or its kind
    way         m, along the path from the laser
    radius      (2,) m at 1/e^2, in x and y; NaN behind a reflector that clips
    curvature   (2,) 1/m, of the wavefront, above zero where it spreads; NaN likewise
    aperture    m, radius; infinite without
    clipped     share of the arriving power that passes beside it; NaN where diffraction could not be followed
    power       W, behind the element; NaN where diffraction could not be followed
    """

    leg: str
    name: str
    way: float
    radius: Array
    curvature: Array
    aperture: float
    clipped: float
    power: float


@dataclass(frozen=True, eq=False)
class Returned:
    """What comes back from one distance.

    distance    m
    radius      (2,) m, of the beam at the reflector
    hit         share of the beam that falls on the reflector
    collected   share of what it sends back that passes all inward apertures
    power       W on the detector
    status      "ok", or why there is no number
    """

    distance: float
    radius: Array
    hit: float
    collected: float
    power: float
    status: str


@dataclass(frozen=True, eq=False)
class BeamPath:
    """A beam train, computed.

    places         along the path at the train's own distance
    status         "ok", or why there is no number there
    returned       table by distance
    smallest_waist m: waist at the head that would make the spot at that distance smallest, and the spot's radius
    range_effects  name: m that the range reads too long by it; NaN where the light there is not a Gaussian
    u_image        m, standard uncertainty of the range from the image's place on the detector; NaN if not known
    laser          what comes back into the laser, by name; empty without an isolator or `back_reflection`
    """

    train: BeamTrain
    places: tuple[BeamPlace, ...]
    status: str
    returned: tuple[Returned, ...]
    smallest_waist: tuple[float, float]
    range_effects: dict[str, float]
    u_image: float
    laser: dict[str, float]


def reduce_beam(train: BeamTrain) -> BeamPath:
    """Everything that the record of a beam train says about its light.

    train   the record

    Raises InputError where a glass, a coating or the geometry has no meaning.

    Source: [SIEGMAN86] ch. 15, 17, 20; [COLLINS70] for what returns; see each formula.
    """
    try:
        leaving, outward, power = _outward(train)
        here, back = _returned(train, leaving, power, train.distance_m, sum(map(_length, train.outward)))
        distances = train.distances_m or tuple(train.distance_m * 2.0**k for k in range(-3, 4))
        rows = tuple(_returned(train, leaving, power, distance, 0.0)[0] for distance in distances)
        wavelength = train.wavelength_um * MICROMETRE
        worst = max(train.laser.quality_x, train.laser.quality_y)
        waist = float(gaussian_beam.waist_for(train.distance_m, wavelength, worst))
        return BeamPath(
            train=train,
            places=(*outward, *back),
            status=here.status,
            returned=rows,
            smallest_waist=(waist, waist * math.sqrt(2.0)),
            range_effects=range_effects(train, back),
            u_image=_u_image(train),
            laser=_into_laser(train),
        )
    except ValidityError as problem:
        raise InputError(f"{train.name}: {problem}") from problem


def range_effects(train: BeamTrain, back: tuple[BeamPlace, ...]) -> dict[str, float]:
    """Metres that a range reads too long by mirror coatings, receiving lenses and the place of the image.

    train   the record
    back    places from the reflector on

    Constants that the internal reference and a zero take up, as long as nothing about them changes: the size of the
    light on the lens, the angle on the mirror, the image's place do.

    Source: `coating.group_path`, `receiver.lens_group_range`, `detector.spot_range`.
    """
    effects: dict[str, float] = {}
    for element in (*train.outward, *train.inward):
        if element.kind == "mirror" and element.coating is not None:
            path = _reflected(train, element)[1]
            effects[f"coating of {_called(element)}"] = effects.get(f"coating of {_called(element)}", 0.0) + 0.5 * path
    inward = [place for place in back if place.leg == "inward"]
    for element, place in zip((e for e in train.inward if e.kind != "space"), inward, strict=True):
        if element.kind == "thick_lens":
            n_p, n_g = _indices(train, element)
            light = float(np.sqrt(np.mean(place.radius**2)))
            bent = {"powers": -float(_matrices(train, element)[0][1, 0]), "phase": n_p, "group": n_g}
            edge = min(place.aperture, WIDE * light)
            effects[f"group lag of {_called(element)}"] = float(receiver.lens_group_range(edge, light, **bent))
    effects.update(_image_effects(train, back[-1]))
    return effects


def _diode(train: BeamTrain) -> detector.Photodiode | None:
    plate = train.detector
    if plate.sheet_resistance_ohm is None or plate.capacitance_pf is None:
        return None
    return detector.Photodiode(plate.radius_mm * MILLIMETRE, plate.sheet_resistance_ohm, plate.capacitance_pf * 1e-12)


def _image_effects(train: BeamTrain, image: BeamPlace) -> dict[str, float]:
    """What the photodiode adds by the place of the image."""
    diode, plate = _diode(train), train.detector
    if diode is None:
        return {}
    spot = float(np.sqrt(np.mean(image.radius**2))) if plate.spot_um is None else plate.spot_um * MICROMETRE
    middle, off = "image in the middle of the detector, against its rim", "image off the middle"
    if not math.isfinite(spot):
        return {middle: math.nan, off: math.nan}
    centre = float(detector.spot_range(0.0, spot, diode, modulation_hz=train.modulation_hz))
    wandering = math.hypot(spot, 2.0 * plate.u_offset_um * MICROMETRE)  # a place that is not certain widens the mean
    here = float(detector.spot_range(plate.offset_um * MICROMETRE, wandering, diode, modulation_hz=train.modulation_hz))
    return {middle: centre, off: here - centre}


def _u_image(train: BeamTrain) -> float:
    diode, plate = _diode(train), train.detector
    if diode is None:
        return math.nan
    at, u = plate.offset_um * MICROMETRE, plate.u_offset_um * MICROMETRE
    return float(detector.spot_range_uncertainty(at, u, diode))


def _into_laser(train: BeamTrain) -> dict[str, float]:
    """Isolation, what comes back into the laser, and the most that its fringes move a range."""
    quantities: dict[str, float] = {}
    share, as_it_left = 1.0, 1.0
    for element in train.outward:
        if element.kind == "isolator":
            device = _isolator(element)
            left = isolator.jones_out(device)[:, 0]
            share, as_it_left = share * isolator.back_share(device), as_it_left * isolator.back_share(device, left)
            quantities["isolation_db"], quantities["worst_isolation_db"] = _decibel(as_it_left), _decibel(share)
    if train.laser.back_reflection is None:
        return quantities
    share *= train.laser.back_reflection
    half = SPEED_OF_LIGHT / train.modulation_hz / (2.0 * TWO_PI)  # m for each radian of the modulation
    contrast = float(fringe_contrast(share))
    quantities["share_into_laser"] = share
    quantities["power_contrast"] = contrast
    quantities["range_bound_by_interference"] = 0.5 * contrast * half
    if train.laser.regulation_rad is not None:
        quantities["range_bound_by_regulation"] = abs(train.laser.regulation_rad) * contrast * half
    return quantities


def _decibel(share: float) -> float:
    return -10.0 * math.log10(share) if share > 0.0 else math.inf


def _outward(train: BeamTrain) -> tuple[NDArray[np.complex128], tuple[BeamPlace, ...], float]:
    """The beam (2,) behind the last outward element, the places, and the power."""
    q, power, way, kept = _laser_beam(train), train.laser.power_mw * 1e-3, 0.0, 1.0
    light, places = _light(train), []
    for element in train.outward:
        if element.kind == "space":
            q, way = abcd.onward(q, _matrices(train, element)), way + _length(element)
            power *= element.transmission
            continue
        w = abcd.radius(q, light)
        edge = _aperture(element)
        passed = min(kept, float(gaussian_beam.share_within_ellipse(edge, *w))) if math.isfinite(edge) else kept
        clipped, kept = 1.0 - passed / kept, passed
        power *= (1.0 - clipped) * _transmission(train, element)
        places.append(BeamPlace("outward", _called(element), way, w, abcd.wavefront_curvature(q), edge, clipped, power))
        q, way = abcd.onward(q, _matrices(train, element)), way + _length(element)
    return q, tuple(places), power


def _returned(
    train: BeamTrain, leaving: NDArray[np.complex128], power: float, distance: float, way: float
) -> tuple[Returned, tuple[BeamPlace, ...]]:
    """What comes back from a distance, and the places from the reflector to the detector."""
    light, space = _light(train), abcd.free_space(distance)
    q, face = abcd.onward(leaving, space), train.reflector.radius_mm * MILLIMETRE
    w, way = abcd.radius(q, light), way + distance
    hit = float(gaussian_beam.share_within_ellipse(face, *w))
    whole = 1.0 - hit < UNCLIPPED
    power *= hit * train.reflector.reflectance
    places = [
        BeamPlace(
            "reflector", train.reflector.name or "reflector", way, w, abcd.wavefront_curvature(q), face, 1 - hit, power
        )
    ]
    system, way, kept = np.broadcast_to(space, (2, 2, 2)), way + distance, 1.0
    stop, past_stop, status = None, np.broadcast_to(np.eye(2), (2, 2, 2)), "ok"
    last = train.detector
    steps = [*train.inward, BeamElement(kind="aperture", name="detector", aperture_radius_mm=last.radius_mm)]
    for number, element in enumerate(steps):
        edge, step = _aperture(element), _matrices(train, element)
        ending = number == len(steps) - 1
        if element.kind != "space":
            now, clipped = abcd.onward(q, system), 0.0
            if math.isfinite(edge) and status == "ok":
                try:
                    if whole:
                        share = float(gaussian_beam.share_within_ellipse(edge, *abcd.radius(now, light)))
                        passed = min(kept, share) if not ending else kept * share
                        if ending and stop is not None and np.all(past_stop[:, 0, 1] != 0.0):
                            shares = _detected(abcd.onward(q, stop[1]), light, [stop[0], edge], [past_stop])
                            passed = kept * float(shares[1] / shares[0])
                    elif ending and stop is not None and np.all(past_stop[:, 0, 1] != 0.0):
                        shares = _detected(q, light, [face, stop[0], edge], [stop[1], past_stop])
                        passed = kept * float(shares[2] / shares[1])
                    else:
                        shares = _diffracted(q, light, [face, edge], [system])
                        passed = min(kept, float(shares[1] / shares[0]))
                    if kept - passed > (UNCLIPPED if whole else 0.0) and not ending:
                        stop, past_stop = (edge, system), np.broadcast_to(np.eye(2), (2, 2, 2))
                    clipped, kept = 1.0 - passed / kept, passed
                except ValidityError as problem:
                    status, kept, power = str(problem), math.nan, math.nan
            clipped = clipped if status == "ok" else math.nan
            power *= (1.0 - clipped) * _transmission(train, element)
            size, bend = (
                (abcd.radius(now, light), abcd.wavefront_curvature(now)) if whole else (np.full(2, np.nan),) * 2
            )
            leg = "detector" if ending else "inward"
            places.append(BeamPlace(leg, _called(element), way, size, bend, edge, clipped, power))
        power *= element.transmission if element.kind == "space" else 1.0
        system, past_stop, way = step @ system, step @ past_stop, way + _length(element)
    return Returned(distance, w, hit, float(kept), float(power), status), tuple(places)


def beam_profile(train: BeamTrain, points: int = 60) -> dict[str, tuple[Array, Array]]:
    """Way (n,), m from the laser, and radii (n, 2), m, along the whole path, by leg: outward, range, back, inward.

    train    the record
    points   on each way through air

    What the beam would be if nothing clipped it.

    Source: `abcd.onward`.
    """
    q, way = _laser_beam(train), 0.0
    there = BeamElement(kind="space", length_mm=train.distance_m / MILLIMETRE)
    legs = {"outward": train.outward, "range": (there,), "back": (there,), "inward": train.inward}
    profile = {}
    for leg, elements in legs.items():
        ways, radii = [np.array([way])], [abcd.radius(q, _light(train))[None]]
        for element in elements:
            inside = np.linspace(0.0, _length(element), points) if element.kind == "space" else np.array([])
            for step in inside[1:]:
                ways.append(np.array([way + step]))
                radii.append(abcd.radius(abcd.onward(q, abcd.free_space(step)), _light(train))[None])
            q, way = abcd.onward(q, _matrices(train, element)), way + _length(element)
        profile[leg] = np.concatenate(ways), np.concatenate(radii)
    return profile


def _diffracted(q: NDArray[np.complex128], light: Array, discs: list[float], systems: list[Array]) -> Array:
    return gaussian_beam.powers_through(q, wavelengths=light, discs=discs, systems=systems)


def _detected(q: NDArray[np.complex128], light: Array, discs: list[float], systems: list[Array]) -> Array:
    """Shares (d,) of the light within discs, the detector last; one that is wider than all light takes it all.

    That is within the 2/(pi ALL_LIGHT), 2 %, that an evenly lit edge spreads beyond; within 0.5 % of usual beams.
    """
    try:
        return _diffracted(q, light, discs, systems)
    except ValidityError:
        given: dict[str, Any] = {"wavelengths": light, "discs": discs, "systems": systems}
        if gaussian_beam.lit_edges(q, **given, spread=ALL_LIGHT)[-1] >= discs[-1]:
            raise
    shares = _diffracted(q, light, discs[:-1], systems[:-1])
    return np.append(shares, shares[-1])


def _light(train: BeamTrain) -> Array:
    """Wavelength times M^2 (2,), m."""
    return train.wavelength_um * MICROMETRE * np.array([train.laser.quality_x, train.laser.quality_y])


def _laser_beam(train: BeamTrain) -> NDArray[np.complex128]:
    """The beam (2,) at the waist of y."""
    laser, light = train.laser, _light(train)
    waists = np.array([_waist(laser, axis, light[k]) for k, axis in enumerate("xy")])
    q = abcd.beam_at_waist(waists, light)
    return q + np.array([laser.astigmatism_um * MICROMETRE, 0.0])


def _waist(laser: Laser, axis: str, light: float) -> float:
    """Radius of the waist, m: given, or wavelength M^2/(pi tan half angle)."""
    waist = getattr(laser, f"waist_{axis}_um")
    if waist is not None:
        return waist * MICROMETRE
    return light / (math.pi * math.tan(HALF_MAXIMUM * getattr(laser, f"divergence_{axis}_deg") * DEGREE))


def _matrices(train: BeamTrain, element: BeamElement) -> Array:
    """Matrices (2, 2, 2) of an element in the planes of x and y."""
    if element.kind == "space":
        return np.broadcast_to(abcd.free_space(_length(element)), (2, 2, 2))
    if element.kind == "lens":
        lens = abcd.thin_lens((element.focal_length_mm or math.inf) * MILLIMETRE)
        return np.stack([lens if element.acts in (None, "both", axis) else np.eye(2) for axis in "xy"])
    if element.kind == "thick_lens":
        r1, r2 = (math.inf if r is None else r * MILLIMETRE for r in (element.r1_mm, element.r2_mm))
        thickness = (element.thickness_mm or 0.0) * MILLIMETRE
        index = _indices(train, element)[0]
        return np.broadcast_to(abcd.thick_lens(r1, r2, thickness=thickness, index=index), (2, 2, 2))
    angle, plane = (element.incidence_deg or 0.0) * DEGREE, element.plane or "x"
    if element.kind == "mirror" and element.radius_mm is not None:
        hollow = element.radius_mm * MILLIMETRE
        return np.stack([abcd.mirror(hollow, angle, in_plane=axis == plane) for axis in "xy"])
    if element.kind == "plate":
        thickness, index = (element.thickness_mm or 0.0) * MILLIMETRE, _indices(train, element)[0]
        return np.stack([abcd.plate(thickness, index, angle, in_plane=axis == plane) for axis in "xy"])
    return np.broadcast_to(np.eye(2), (2, 2, 2))


def _transmission(train: BeamTrain, element: BeamElement) -> float:
    """Of an element, the reflectance of its coating and an isolator's own angles in it."""
    if element.kind == "mirror" and element.coating is not None:
        return element.transmission * _reflected(train, element)[0]
    if element.kind == "isolator":
        return isolator.forward_share(_isolator(element))
    return element.transmission


def _isolator(element: BeamElement) -> isolator.Isolator:
    """An isolator whose first polarizer lies along the laser's field."""
    usual = isolator.Isolator()
    return isolator.Isolator(
        turn=usual.turn if element.turn_deg is None else element.turn_deg * DEGREE,
        leak=usual.leak if element.leak is None else element.leak,
        transmission=element.transmission,
    )


def _reflected(train: BeamTrain, element: BeamElement) -> tuple[float, float]:
    """Reflectance of a coated mirror, and the group path, m, that it adds, for the polarization that it meets."""
    angle = (element.incidence_deg or 0.0) * DEGREE
    mirror_coating = coating.named(element.coating or "", train.wavelength_um, angle)
    power, path = 0.0, 0.0
    for polarization, share in _polarization(train, element).items():
        response = coating.response(mirror_coating, train.wavelength_um, angle, polarization=polarization)
        reflected = share * float(response.reflectance)
        added = float(coating.group_path(mirror_coating, train.wavelength_um, angle, polarization=polarization))
        power, path = power + reflected, path + reflected * added
    return power, path / power


def _polarization(train: BeamTrain, element: BeamElement) -> Mapping[coating.Polarization, float]:
    """Shares of s and p on a mirror: each isolator on the way leaves the field turned by half a right angle.

    A retroreflector is taken to keep the polarization.
    """
    passed = sum(e.kind == "isolator" for e in takewhile(lambda e: e is not element, train.outward))
    kept = math.cos(passed * isolator.DESIGN_TURN) ** 2
    along = train.laser.polarization == (element.plane or "x")
    return {"p": kept if along else 1.0 - kept, "s": 1.0 - kept if along else kept}


def _indices(train: BeamTrain, element: BeamElement) -> tuple[float, float]:
    """Phase and group index of an element's glass over air."""
    name = element.glass or ""
    return float(glass.phase_index(train.wavelength_um, name)), float(glass.group_index(train.wavelength_um, name))


def _length(element: BeamElement) -> float:
    """Way, m, that an element adds to the path: its thickness, not its optical path."""
    return (element.length_mm or element.thickness_mm or 0.0) * MILLIMETRE


def _aperture(element: BeamElement) -> float:
    return math.inf if element.aperture_radius_mm is None else element.aperture_radius_mm * MILLIMETRE


def _called(element: BeamElement) -> str:
    return element.name or element.kind.replace("_", " ")
