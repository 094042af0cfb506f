"""Beam train from its record: sizes, clipping, power, effects on a range.

Outward the beam is Gaussian in two planes; an aperture removes its share and the remainder stays Gaussian: diffraction
rings behind a strongly clipping edge are not modelled. From the reflector on the light is computed by diffraction,
except where the reflector clips almost nothing: then it stays Gaussian as far as the detector, which receives the light
that the tightest inward aperture passes. Apertures in a row pass the light of the tightest of them.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.constants import DEGREE, MILLIMETRE, SPEED_OF_LIGHT, TWO_PI
from catseye.errors import InputError, ValidityError
from catseye.optics import abcd, coating, detector, gaussian_beam, glass, isolator, receiver
from catseye.records.files.reading import Folder
from catseye.records.site.beam import BeamElement, BeamTrain, Laser
from catseye.reduction.optics.receiving import ReceivingOptics, TracedImage, receiving_optics, traced_image
from catseye.signal.systematics.feedback import fringe_contrast
from catseye.verdict import Verdict

WIDE = 5.0  # beam radii: size of a missing aperture
UNCLIPPED = 1e-5  # of the power lost: the beam then stays Gaussian, to 1e-3 of a share, 5e-3 through a pinhole
ALL_LIGHT = 30.0  # rad of diffraction beyond the rays, see `gaussian_beam.SPREADS`
HALF_MAXIMUM = math.sqrt(2.0 / math.log(2.0)) / 2.0  # full angle at half maximum to half angle at 1/e^2
MICROMETRE = 1e-6


@dataclass(frozen=True, eq=False)
class BeamPlace:
    """Beam at an element.

    leg         "outward", "reflector", "inward", "detector"
    name        of the element, or its kind
    way         m, along the path from the laser
    radius      (2,) m at 1/e^2, in x and y; NaN behind a reflector that clips
    curvature   (2,) 1/m, of the wavefront, above zero where it spreads; NaN likewise
    aperture    m, radius; infinite without
    clipped     share of the arriving power that it blocks; NaN where diffraction could not be computed
    power       W, behind the element; NaN where diffraction could not be computed
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
    """Return from one distance.

    distance    m
    radius      (2,) m, of the beam at the reflector
    hit         share of the beam that falls on the reflector
    collected   share of the returned light that passes all inward apertures
    power       W on the detector
    status      "ok", or the reason for a missing number
    """

    distance: float
    radius: Array
    hit: float
    collected: float
    power: float
    status: str


@dataclass(frozen=True, eq=False)
class BeamPath:
    """Computed beam train.

    places         along the path at the train's own distance
    status         "ok", or the reason for a missing number there
    returned       table by distance
    smallest_waist m: waist at the head for the smallest spot at that distance, and the spot's radius
    range_effects  name: m, range error (positive: too long); NaN where the light there is not Gaussian
    u_image        m, standard uncertainty of the range from the image's place on the detector; NaN if not known
    receiving      focal length, defocus and image of the optics before the detector
    detector_lag   rad, of the detector's centre behind its rim: of a mirror's sheet; NaN if not known
    laser          what comes back into the laser, by name; empty without an isolator or `back_reflection`
    """

    train: BeamTrain
    places: tuple[BeamPlace, ...]
    status: str
    returned: tuple[Returned, ...]
    smallest_waist: tuple[float, float]
    range_effects: dict[str, float]
    u_image: float
    receiving: ReceivingOptics
    detector_lag: float
    laser: dict[str, float]

    @property
    def verdict(self) -> Verdict:
        """Good where the power is known at every distance."""
        if self.status != "ok":
            return Verdict("doubtful", self.status)
        failures = [row for row in self.returned if row.status != "ok"]
        if failures:
            distances = ", ".join(f"{row.distance:g}" for row in failures)
            return Verdict("doubtful", f"no power from {distances} m: {failures[0].status}")
        return Verdict("good", "every element passes the beam")


def read_beam(file: Path, distance: float | None = None) -> tuple[BeamPath, dict[str, str]]:
    """Beam train of a file, reduced, and the file's hash.

    file       the record
    distance   m, overrides the record's
    """
    folder = Folder(file.parent)
    train = folder.record(file.name, BeamTrain)
    if distance is not None:
        train = train.model_copy(update={"distance_m": distance})
    return reduce_beam(train), folder.hashes


def reduce_beam(train: BeamTrain) -> BeamPath:
    """Light of a beam train, computed from its record.

    train   the record

    Raises InputError where a glass, a coating or the geometry is invalid.

    Source: [PARKER04] figure 6.1 for the elements; [SIEGMAN86] ch. 15, 17, 20; [COLLINS70] for the return; see each
    formula.
    """
    try:
        leaving, outward, power = _outward(train)
        returned, back = _returned(train, leaving, power, train.distance_m, sum(map(_length, train.outward)))
        distances = train.distances_m or tuple(train.distance_m * 2.0**k for k in range(-3, 4))
        rows = tuple(_returned(train, leaving, power, distance, 0.0)[0] for distance in distances)
        wavelength = train.wavelength_um * MICROMETRE
        worst = max(train.laser.quality_x, train.laser.quality_y)
        waist = float(gaussian_beam.waist_for(train.distance_m, wavelength, worst))
        return BeamPath(
            train=train,
            places=(*outward, *back),
            status=returned.status,
            returned=rows,
            smallest_waist=(waist, waist * math.sqrt(2.0)),
            range_effects=range_effects(train, back),
            u_image=_u_image(train),
            receiving=_receiving(train, back),
            detector_lag=math.nan if (diode := _diode(train)) is None else diode.lag(train.modulation_hz),
            laser=_into_laser(train),
        )
    except ValidityError as problem:
        raise InputError(f"{train.name}: {problem}") from problem


def range_effects(train: BeamTrain, back: tuple[BeamPlace, ...]) -> dict[str, float]:
    """Range errors (m) by mirror coatings, receiving lenses and the image's place.

    train   the record
    back    places from the reflector on

    Constants that the internal reference and a zero absorb as long as they do not change; the size of the light on the
    lens, the angle on the mirror and the image's place do change.

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
            if (image := _traced(train, back)) is not None:
                effects[f"spherical aberration of {_called(element)}"] = image.range_error
    effects.update(_image_effects(train, back[-1]))
    return effects


def _receiving(train: BeamTrain, back: tuple[BeamPlace, ...]) -> ReceivingOptics:
    """Receiving optics; places from the reflector on."""
    matrices = [_matrices(train, element) for element in train.inward]
    focal_length, defocus = receiving_optics(matrices, image=(back[-1].radius, back[-1].curvature), light=_light(train))
    return ReceivingOptics(focal_length, defocus, _traced(train, back))


def _traced(train: BeamTrain, back: tuple[BeamPlace, ...]) -> TracedImage | None:
    """Image by exact rays; None where another element than one thick lens bends the light, or it is not Gaussian."""
    bending = [
        element
        for element in train.inward
        if element.kind in ("lens", "thick_lens", "plate") or (element.kind == "mirror" and element.radius_mm)
    ]
    if len(bending) != 1 or bending[0].kind != "thick_lens":
        return None
    lens = bending[0]
    solid = [element for element in train.inward if element.kind != "space"]
    at = next(k for k, element in enumerate(solid) if element is lens)
    beam_radius = float(np.sqrt(np.mean([p for p in back if p.leg == "inward"][at].radius ** 2)))
    if not math.isfinite(beam_radius):
        return None
    after = train.inward[next(k for k, element in enumerate(train.inward) if element is lens) + 1 :]
    r1, r2 = (math.inf if r is None else r * MILLIMETRE for r in (lens.r1_mm, lens.r2_mm))
    return traced_image(
        beam_radius,
        aperture=_aperture(lens),
        surfaces=(r1, r2),
        thickness=_length(lens),
        indices=_indices(train, lens),
        back=sum(map(_length, after)),
        detector=train.detector.radius_mm * MILLIMETRE,
    )


def _diode(train: BeamTrain) -> detector.Photodiode | None:
    plate = train.detector
    if plate.sheet_resistance_ohm is None or plate.capacitance_pf is None:
        return None
    return detector.Photodiode(plate.radius_mm * MILLIMETRE, plate.sheet_resistance_ohm, plate.capacitance_pf * 1e-12)


def _image_effects(train: BeamTrain, image: BeamPlace) -> dict[str, float]:
    """Range errors of the photodiode by the place of the image."""
    diode, plate = _diode(train), train.detector
    if diode is None:
        return {}
    spot = float(np.sqrt(np.mean(image.radius**2))) if plate.spot_um is None else plate.spot_um * MICROMETRE
    middle, off = "image in the middle of the detector, against its rim", "image off the middle"
    if not math.isfinite(spot):
        return {middle: math.nan, off: math.nan}
    centre = float(detector.spot_range(0.0, spot, diode, modulation_hz=train.modulation_hz))
    wandering = math.hypot(spot, 2.0 * plate.u_offset_um * MICROMETRE)  # an uncertain place widens the mean
    centred = float(
        detector.spot_range(plate.offset_um * MICROMETRE, wandering, diode, modulation_hz=train.modulation_hz)
    )
    return {middle: centre, off: centred - centre}


def _u_image(train: BeamTrain) -> float:
    diode, plate = _diode(train), train.detector
    if diode is None:
        return math.nan
    at, u = plate.offset_um * MICROMETRE, plate.u_offset_um * MICROMETRE
    return float(detector.spot_range_uncertainty(at, u, diode))


def _into_laser(train: BeamTrain) -> dict[str, float]:
    """Isolation, light returning into the laser, and the range error of its fringes.

    The largest error.
    """
    quantities: dict[str, float] = {}
    share, actual_share = 1.0, 1.0
    for element in train.outward:
        if element.kind == "isolator":
            device = _isolator(train, element)
            field = isolator.jones_out(device)[:, 0]
            share, actual_share = share * isolator.back_share(device), actual_share * isolator.back_share(device, field)
            quantities["isolation_db"], quantities["worst_isolation_db"] = _decibel(actual_share), _decibel(share)
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
    """Beam (2,) behind the last outward element, the places, and the power."""
    q, power, path, passed_share = _laser_beam(train), train.laser.power_mw * 1e-3, 0.0, 1.0
    light, places = _light(train), []
    for element in train.outward:
        if element.kind == "space":
            q, path = abcd.onward(q, _matrices(train, element)), path + _length(element)
            power *= element.transmission
            continue
        w = abcd.radius(q, light)
        edge = _aperture(element)
        passed = (
            min(passed_share, float(gaussian_beam.share_within_ellipse(edge, *w)))
            if math.isfinite(edge)
            else passed_share
        )
        clipped, passed_share = 1.0 - passed / passed_share, passed
        power *= (1.0 - clipped) * _transmission(train, element)
        places.append(
            BeamPlace(
                leg="outward",
                name=_called(element),
                way=path,
                radius=w,
                curvature=abcd.wavefront_curvature(q),
                aperture=edge,
                clipped=clipped,
                power=power,
            )
        )
        q, path = abcd.onward(q, _matrices(train, element)), path + _length(element)
    return q, tuple(places), power


def _returned(
    train: BeamTrain, leaving: NDArray[np.complex128], power: float, distance: float, path: float
) -> tuple[Returned, tuple[BeamPlace, ...]]:
    """Return from a distance, and the places from reflector to detector."""
    light, space = _light(train), abcd.free_space(distance)
    q, face = abcd.onward(leaving, space), train.reflector.radius_mm * MILLIMETRE
    w, path = abcd.radius(q, light), path + distance
    hit = float(gaussian_beam.share_within_ellipse(face, *w))
    unclipped = 1.0 - hit < UNCLIPPED
    power *= hit * train.reflector.reflectance
    places = [
        BeamPlace(
            leg="reflector",
            name=train.reflector.name or "reflector",
            way=path,
            radius=w,
            curvature=abcd.wavefront_curvature(q),
            aperture=face,
            clipped=1 - hit,
            power=power,
        )
    ]
    system, path, passed_share = np.broadcast_to(space, (2, 2, 2)), path + distance, 1.0
    stop, past_stop, status = None, np.broadcast_to(np.eye(2), (2, 2, 2)), "ok"
    last = train.detector
    steps = [*train.inward, BeamElement(kind="aperture", name="detector", aperture_radius_mm=last.radius_mm)]
    for number, element in enumerate(steps):
        edge, step = _aperture(element), _matrices(train, element)
        ending = number == len(steps) - 1
        if element.kind != "space":
            beam, clipped = abcd.onward(q, system), 0.0
            if math.isfinite(edge) and status == "ok":
                try:
                    if unclipped:
                        share = float(gaussian_beam.share_within_ellipse(edge, *abcd.radius(beam, light)))
                        passed = min(passed_share, share) if not ending else passed_share * share
                        if ending and stop is not None and np.all(past_stop[:, 0, 1] != 0.0):
                            shares = _detected(abcd.onward(q, stop[1]), light, [stop[0], edge], [past_stop])
                            passed = passed_share * float(shares[1] / shares[0])
                    elif ending and stop is not None and np.all(past_stop[:, 0, 1] != 0.0):
                        shares = _detected(q, light, [face, stop[0], edge], [stop[1], past_stop])
                        passed = passed_share * float(shares[2] / shares[1])
                    else:
                        shares = _diffracted(q, light, [face, edge], [system])
                        passed = min(passed_share, float(shares[1] / shares[0]))
                    if passed_share - passed > (UNCLIPPED if unclipped else 0.0) and not ending:
                        stop, past_stop = (edge, system), np.broadcast_to(np.eye(2), (2, 2, 2))
                    clipped, passed_share = 1.0 - passed / passed_share, passed
                except ValidityError as problem:
                    status, passed_share, power = str(problem), math.nan, math.nan
            clipped = clipped if status == "ok" else math.nan
            power *= (1.0 - clipped) * _transmission(train, element)
            size, bend = (
                (abcd.radius(beam, light), abcd.wavefront_curvature(beam)) if unclipped else (np.full(2, np.nan),) * 2
            )
            leg = "detector" if ending else "inward"
            places.append(
                BeamPlace(
                    leg=leg,
                    name=_called(element),
                    way=path,
                    radius=size,
                    curvature=bend,
                    aperture=edge,
                    clipped=clipped,
                    power=power,
                )
            )
        power *= element.transmission if element.kind == "space" else 1.0
        system, past_stop, path = step @ system, step @ past_stop, path + _length(element)
    return Returned(
        distance=distance, radius=w, hit=hit, collected=float(passed_share), power=float(power), status=status
    ), tuple(places)


def beam_profile(train: BeamTrain, points: int = 60) -> dict[str, tuple[Array, Array]]:
    """Path (n,), m from the laser, and radii (n, 2), m, by leg.

    Legs outward, range, back, inward.

    train    the record
    points   on each path through air

    The unclipped beam.

    Source: `abcd.onward`.
    """
    q, path = _laser_beam(train), 0.0
    space = BeamElement(kind="space", length_mm=train.distance_m / MILLIMETRE)
    legs = {"outward": train.outward, "range": (space,), "back": (space,), "inward": train.inward}
    profile = {}
    for leg, elements in legs.items():
        ways, radii = [np.array([path])], [abcd.radius(q, _light(train))[None]]
        for element in elements:
            inside = np.linspace(0.0, _length(element), points) if element.kind == "space" else np.array([])
            for step in inside[1:]:
                ways.append(np.array([path + step]))
                radii.append(abcd.radius(abcd.onward(q, abcd.free_space(step)), _light(train))[None])
            q, path = abcd.onward(q, _matrices(train, element)), path + _length(element)
        profile[leg] = np.concatenate(ways), np.concatenate(radii)
    return profile


def _diffracted(q: NDArray[np.complex128], light: Array, discs: list[float], systems: list[Array]) -> Array:
    return gaussian_beam.powers_through(q, wavelengths=light, discs=discs, systems=systems)


def _detected(q: NDArray[np.complex128], light: Array, discs: list[float], systems: list[Array]) -> Array:
    """Shares (d,) of the light within discs, the detector last.

    A disc wider than all light receives it all.

    That is within the 2/(pi ALL_LIGHT), 2 %, that an evenly lit edge spreads beyond; within 0.5 % of usual beams.
    """
    try:
        return _diffracted(q, light, discs, systems)
    except ValidityError:
        arguments: dict[str, Any] = {"wavelengths": light, "discs": discs, "systems": systems}
        if gaussian_beam.lit_edges(q, **arguments, spread=ALL_LIGHT)[-1] >= discs[-1]:
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
    """Radius of the waist, m: typed, or wavelength M^2/(pi tan half angle)."""
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
    """Transmission of an element.

    Reflectance of its coating and an isolator's angles included.
    """
    if element.kind == "mirror" and element.coating is not None:
        return element.transmission * _reflected(train, element)[0]
    if element.kind == "isolator":
        return isolator.forward_share(_isolator(train, element))
    return element.transmission


def _isolator(train: BeamTrain, element: BeamElement) -> isolator.Isolator:
    """Isolator with its first polarizer along the laser's field.

    Its turn holds at 20 °C and the train's wavelength; warmer, the rotator turns by less.
    """
    usual, light = isolator.Isolator(), train.wavelength_um
    turn = usual.turn if element.turn_deg is None else element.turn_deg * DEGREE
    if element.temperature_c is not None:
        turned = isolator.faraday_turn(light, element.temperature_c, design_um=light)
        turn *= float(turned) / isolator.DESIGN_TURN
    return isolator.Isolator(
        turn=turn,
        leak=usual.leak if element.leak is None else element.leak,
        transmission=element.transmission,
    )


def _reflected(train: BeamTrain, element: BeamElement) -> tuple[float, float]:
    """Reflectance of a coated mirror, and its group path, m.

    For the polarization that it meets.
    """
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
    """Shares of s and p polarization on a mirror.

    Each isolator on the path turns the field by half a right angle.

    A retroreflector is assumed to keep the polarization.
    """
    passed = sum(e.kind == "isolator" for e in takewhile(lambda e: e is not element, train.outward))
    s_share = math.cos(passed * isolator.DESIGN_TURN) ** 2
    along = train.laser.polarization == (element.plane or "x")
    return {"p": s_share if along else 1.0 - s_share, "s": 1.0 - s_share if along else s_share}


def _indices(train: BeamTrain, element: BeamElement) -> tuple[float, float]:
    """Phase and group index of an element's glass over air."""
    name = element.glass or ""
    return float(glass.phase_index(train.wavelength_um, name)), float(glass.group_index(train.wavelength_um, name))


def _length(element: BeamElement) -> float:
    """Path length, m, of an element: its thickness, not its optical path."""
    return (element.length_mm or element.thickness_mm or 0.0) * MILLIMETRE


def _aperture(element: BeamElement) -> float:
    return math.inf if element.aperture_radius_mm is None else element.aperture_radius_mm * MILLIMETRE


def _called(element: BeamElement) -> str:
    return element.name or element.kind.replace("_", " ")
