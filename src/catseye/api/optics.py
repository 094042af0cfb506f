"""`glass`, `link`, `safety`, `beam`: optics of a ranger's head, its reflectors and its hazards."""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import ArgumentError
from catseye.reduction.optics.link import Link, LinkReflector

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.optics.beam import BeamPath
    from catseye.reduction.optics.link_budget import LinkBudget

DISTANCES = (0.01, 1e6)  # m, of a beam's reflector
SAFETY_ROWS = {  # column -> key of a duration's row, and unit
    "duration": ("duration", "s"),
    "mpe_eye": ("mpe_eye", "W / m2"),
    "mpe_skin": ("mpe_skin", "W / m2"),
    "hazard_distance": ("nohd", "m"),
    "hazard_distance_aided": ("nohd_aided", "m"),
    "skin_hazard_distance": ("skin_hazard_distance", "m"),
}


@dataclass(frozen=True, eq=False, repr=False)
class GlassResult(Result):
    """A glass, or all of them.

    name     of the glass; None: all
    values   by JSON's keys
    """

    name: str | None
    values: Mapping[str, Any]

    def passages(self) -> "Sequence[Passage]":
        """Indices, slopes, effects of a prism, and errors of another glass."""
        from catseye.gateways.optics.glass_objects import glass_rows, table_rows
        from catseye.gateways.writers.passage import Passage

        return [Passage(*row) for row in (table_rows() if self.name is None else glass_rows(dict(self.values)))]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye glass --json`."""
        return dict(self.values)

    def tables(self) -> "dict[str, QTable]":
        """Limits and expansion of all glasses; of one, its indices."""
        if self.name is None:
            glasses = self.values["glasses"]
            columns = {
                "glass": (list(glasses), ""),
                "shortest": ([each["limits_um"][0] for each in glasses.values()], "um"),
                "longest": ([each["limits_um"][1] for each in glasses.values()], "um"),
                "reference": ([each["reference_c"] for each in glasses.values()], "deg_C"),
                "expansion": ([each["expansion_per_c"] for each in glasses.values()], "1 / K"),
            }
            return {"glasses": quantities(columns)}
        keys = {"phase_index": "", "group_index": "", "group_wavelength": "m", "expansion_per_c": "1 / K"}
        columns = {"wavelength": ([self.values["wavelength_um"]], "um")}
        columns |= {key: ([float(self.values[key])], unit) for key, unit in keys.items()}
        columns |= {
            key: ([float(self.values["prism"][key])], "m") for key in ("height", "range_constant", "reference_depth")
        }
        return {"glass": quantities(columns, name=self.name)}


@with_units
def glass(
    name: str | None = None,
    *,
    wavelength_um: Annotated[Any, In("um", one=True)] = 0.780,
    temperature_c: Annotated[Any, In("deg_C", one=True)] = 20.0,
    height_mm: Annotated[Any, In("mm", one=True)] = 38.1,
    plate_mm: Annotated[Any, In("mm", one=True)] = None,
) -> GlassResult:
    """Indices of a glass, a prism of it, and errors of another glass.

    name            of a glass; None: a table of all
    wavelength_um   in vacuum, µm
    temperature_c   of the glass, °C
    height_mm       of a prism at 20 °C, face to corner, mm
    plate_mm        from the face of a mirror to the face of the prism in its back, mm; None: no mirror

    Raises ValidityError: unknown glass, a value outside its formula; ArgumentError: no height of a prism, no plate,
    or a plate without a glass. Source: [PARKER04] section 2.4 for the cube in the back of a mirror.

    >>> round(float(glass("BK7-old", height_mm=38.4).values["notes_group_index"]), 8)
    1.52746375
    """
    from catseye.gateways.optics.glass_objects import glass_object, table_object
    from catseye.reduction.optics.glass import ALL_GLASSES, glass_state, require_height

    if name is None:
        require_height(height_mm)
        if plate_mm is not None:
            raise ArgumentError(
                "plate_mm is that of a prism of one glass (expected the name of a glass, too)", "plate_mm"
            )
        return GlassResult(ALL_GLASSES, None, table_object())
    state = glass_state(name, wavelength_um, temperature_c, height_mm=height_mm, plate_mm=plate_mm)
    return GlassResult(state.verdict, name, glass_object(state))


@dataclass(frozen=True, eq=False, repr=False)
class LinkResult(Result):
    """A link budget.

    budget     each factor, the return and its noise
    head       link with the gain that was used
    distance   m
    """

    budget: "LinkBudget"
    head: Link
    distance: float

    def passages(self) -> "Sequence[Passage]":
        """The return, the noise of a range, and the crosstalk."""
        from catseye.gateways.writers.passage import Passage

        b = self.budget
        return [
            Passage("return", f"{b.amplitude_volt:.4g} V from {b.received * 1e3:.4g} mW on the detector"),
            Passage("noise", f"{b.u_range * 1e6:.4g} µm of a range, {b.u_phase * 1e3:.3g} mrad of its phase"),
            Passage("crosstalk", f"{b.crosstalk_range * 1e6:.4g} µm at most"),
        ]

    def rows(self) -> Iterator[str]:
        """Every factor and every source of noise as a line of text."""
        b = self.budget
        yield f"{'laser':<32}{self.head.power * 1e3:10.4g} mW"
        for name, share in b.factors.items():
            yield f"{name:<32}{10 * math.log10(share):10.2f} dB"
        yield f"{'on the detector':<32}{b.received * 1e3:10.4g} mW"
        clipped = "  more than the converter takes: it clips" if b.clipped else ""
        yield f"{'amplitude of the return':<32}{b.amplitude_volt:10.4g} V{clipped}"
        yield f"{'noise of the range':<32}{b.u_range * 1e6:10.4g} µm  (u of phase {b.u_phase * 1e3:.3g} mrad)"
        for name, share in sorted(b.noise_shares.items(), key=lambda item: -item[1]):
            yield f"{'':<4}{name:<28}{100 * share:10.3g} %"
        yield f"{'crosstalk left, at worst':<32}{b.crosstalk_range * 1e6:10.4g} µm"
        if b.deviation:
            yield f"{'deviation by dihedral errors':<32}{b.deviation / ARCSECOND:10.4g} arc seconds at most"
            yield f"{'their range error, no lens':<32}{b.pupil_offset * 1e6:+10.4g} µm"

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye link --json`."""
        b = self.budget
        return {
            "verdict": self.verdict.to_object(),
            "distance": self.distance,
            "factors": b.factors,
            "received_power": b.received,
            "amplitude_volt": b.amplitude_volt,
            "u_volt": b.u_volt,
            "u_phase": b.u_phase,
            "u_range": b.u_range,
            "crosstalk_range": b.crosstalk_range,
            "noise_shares": b.noise_shares,
            "volts_per_ampere": self.head.volts_per_ampere,
            "clipped": b.clipped,
            "deviation": b.deviation,
            "pupil_offset": b.pupil_offset,
        }

    def tables(self) -> "dict[str, QTable]":
        """Factors of the power, and shares of the noise."""
        return {
            name: quantities({"part": (list(shares), ""), "share": (list(shares.values()), "")})
            for name, shares in (("factors", self.budget.factors), ("noise", self.budget.noise_shares))
        }


@with_units
def link(
    distance: Annotated[Any, In("m", one=True)],
    *,
    incidence_deg: Annotated[Any, In("deg", one=True)] = 0.0,
    offset_mm: Annotated[Any, In("mm", one=True)] = 0.0,
    power_mw: Annotated[Any, In("mW", one=True)] = Link.power * 1e3,
    depth: Annotated[Any, In("", one=True)] = Link.depth,
    waist_mm: Annotated[Any, In("mm", one=True)] = Link.waist * 1e3,
    receiver_mm: Annotated[Any, In("mm", one=True)] = Link.receiver * 1e3,
    transmission: Annotated[Any, In("", one=True)] = Link.transmission,
    aperture_mm: Annotated[Any, In("mm", one=True)] = LinkReflector.aperture * 1e3,
    height_mm: Annotated[Any, In("mm", one=True)] = LinkReflector.height * 1e3,
    index: Annotated[Any, In("", one=True)] = LinkReflector.index,
    dihedral_arcsec: Annotated[Any, In("arcsec")] = None,
    duration: Annotated[Any, In("s", one=True)] = Link.duration,
    blocked_noise_volt: Annotated[Any, In("V", one=True)] = Link.blocked_noise_volt,
    background_uw: Annotated[Any, In("uW", one=True)] = 0.0,
    measured_volt: Annotated[Any, In("V", one=True)] = None,
) -> LinkResult:
    """Link budget: laser's power to expected return and range noise.

    distance             ranger to retroreflector, m
    incidence_deg        on the reflector's face, degrees
    offset_mm            of the beam's axis from the reflector's centre, mm
    power_mw, depth      mean power of the laser, mW; modulation depth, 0 to 1
    waist_mm             radius of the outgoing beam at 1/e², mm
    receiver_mm          radius of the receiving lens, mm
    transmission         of the head's optics, out and back
    aperture_mm, height_mm, index   radius of the reflector's clear face, corner behind it, mm; 1 for a hollow cube
    dihedral_arcsec      excess of its three angles over right ones, or one value for all, arc seconds; None: none
    duration             of one range, s
    blocked_noise_volt   rms of the samples with the beam blocked, V
    background_uw        daylight on the detector, µW
    measured_volt        return measured straight on at this distance, V: sets the gain

    Raises ValidityError: values without meaning, no light that comes back.

    >>> round(link(120.0, incidence_deg=20.0, measured_volt=4.5).budget.amplitude_volt, 2)
    4.49
    """
    from catseye.reduction.optics.link_budget import link_budget

    head = Link(
        power=power_mw * 1e-3,
        depth=depth,
        waist=waist_mm * MILLIMETRE,
        receiver=receiver_mm * MILLIMETRE,
        transmission=transmission,
        duration=duration,
        blocked_noise_volt=blocked_noise_volt,
    )
    errors = np.atleast_1d(np.asarray(0.0 if dihedral_arcsec is None else dihedral_arcsec, dtype=float))
    if errors.shape not in ((1,), (3,)):
        raise ArgumentError(f"dihedral_arcsec has {errors.size} values (expected one or three)", "dihedral_arcsec")
    first, second, third = (float(value) * ARCSECOND for value in np.broadcast_to(errors, 3))
    reflector = LinkReflector(
        aperture=aperture_mm * MILLIMETRE,
        height=height_mm * MILLIMETRE,
        index=index,
        dihedral=(first, second, third),
    )
    if measured_volt is not None:
        head = head.scaled(link_budget(head, reflector, distance).amplitude_volt, measured_volt)
    light = {"incidence": incidence_deg * DEGREE, "background": background_uw * 1e-6}
    budget = link_budget(head, reflector, distance, offset=offset_mm * MILLIMETRE, **light)
    return LinkResult(budget.verdict, budget, head, distance)


@dataclass(frozen=True, eq=False, repr=False)
class SafetyResult(Result):
    """Limits of exposure, class and hazard distances: for planning, never a certificate.

    values   by JSON's keys
    """

    values: Mapping[str, Any]

    def passages(self) -> "Sequence[Passage]":
        """Class, limits, hazards, and what is not covered."""
        from catseye.gateways.optics.safety_objects import safety_passages
        from catseye.gateways.writers.passage import Passage

        return [Passage(*row) for row in safety_passages(dict(self.values))]

    def rows(self) -> Iterator[str]:
        """The table of durations as lines of text."""
        from catseye.gateways.optics.safety_objects import safety_table

        yield from safety_table(dict(self.values)).splitlines()

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye safety --json`."""
        return dict(self.values)

    def tables(self) -> "dict[str, QTable]":
        """Limits and hazard distances by duration of exposure."""
        rows = self.values["what_if"]
        return {
            "durations": quantities(
                {name: ([float(row[key]) for row in rows], unit) for name, (key, unit) in SAFETY_ROWS.items()}
            )
        }


@with_units
def safety(
    power_mw: Annotated[Any, In("mW", one=True)],
    wavelength_um: Annotated[Any, In("um", one=True)],
    diameter_mm: Annotated[Any, In("mm", one=True)],
    divergence_mrad: Annotated[Any, In("mrad", one=True)],
    *,
    waist_distance: Annotated[Any, In("m", one=True)] = 0.0,
    duration_s: Annotated[Any, In("s", one=True)] = None,
    aided: bool = False,
    scan_rad_per_s: Annotated[Any, In("rad / s", one=True)] = None,
    scan_period_s: Annotated[Any, In("s", one=True)] = None,
    reflector_distance: Annotated[Any, In("m", one=True)] = None,
    reflector_diameter_mm: Annotated[Any, In("mm", one=True)] = 50.8,
    subtense_mrad: Annotated[Any, In("mrad", one=True)] = 1.5,
    edition: str = "iec2014",
) -> SafetyResult:
    """Laser safety of a beam: limits of exposure, class, hazard distances.

    power_mw          of the beam, continuous, mW
    wavelength_um     0.4 to 1.4 µm
    diameter_mm       at 1/e² where the beam leaves, mm
    divergence_mrad   full angle at 1/e², mrad
    waist_distance    narrowest place, m from where it leaves
    duration_s        of the exposure; None: 0.25 s for visible light, else 100 s
    aided             sweep, return and near end of the hazard for 7x50 binoculars
    scan_rad_per_s, scan_period_s   rate at which the beam turns; s from one pass to the next, None: a single pass
    reflector_distance, reflector_diameter_mm   of a retroreflector that sends the beam back, m and mm
    subtense_mrad     angle of the apparent source at the eye, mrad; up to 1.5 a point
    edition           of the limits: iec2014 or ansi2014

    Raises ValidityError: values outside the limits' tables; ArgumentError: a period without a rate.

    >>> safety(10.0, 0.780, 20.0, 0.05).values["class"]
    '3B'
    """
    from catseye.gateways.optics.safety_objects import safety_object
    from catseye.optics.safety.hazard import LaserBeam
    from catseye.reduction.optics.safety import SafetyQuestion, assess_safety

    assessment = assess_safety(
        SafetyQuestion(
            LaserBeam(power_mw * 1e-3, wavelength_um, diameter_mm * MILLIMETRE, divergence_mrad * 1e-3, waist_distance),
            edition=edition,
            duration=duration_s,
            aided=aided,
            subtense=subtense_mrad * 1e-3,
            scan=scan_rad_per_s,
            period=scan_period_s,
            reflector_distance=reflector_distance,
            reflector_diameter=reflector_diameter_mm * MILLIMETRE,
        )
    )
    return SafetyResult(assessment.verdict, safety_object(assessment))


@dataclass(frozen=True, eq=False, repr=False)
class BeamResult(Result):
    """Laser beam through a head to a retroreflector and back.

    beam     sizes, clipping and power at each element
    source   file that was read
    hashes   SHA-256 of what was read, by name
    """

    beam: "BeamPath"
    source: Path
    hashes: Mapping[str, str]

    def passages(self) -> "Sequence[Passage]":
        """The beam at the reflector and the smallest spot there."""
        from catseye.gateways.writers.passage import Passage

        place = next(each for each in self.beam.places if each.leg == "reflector")
        size = " x ".join(f"{1e3 * radius:.2f}" for radius in place.radius)
        spot = 1e3 * self.beam.smallest_waist[1]
        return [
            Passage(
                "reflector", f"{size} mm at {self.beam.train.distance_m:g} m, {100 * place.clipped:.2g} % beside it"
            ),
            Passage("smallest spot", f"{spot:.3f} mm there"),
        ]

    def rows(self) -> Iterator[str]:
        """The tables as lines of text."""
        from catseye.gateways.optics.beam_figures import lines

        return lines(self.beam)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye beam --json`."""
        from catseye.gateways.optics.beam_figures import beam_object

        return beam_object(self.beam)

    def tables(self) -> "dict[str, QTable]":
        """Elements in the beam's order, and what returns by distance."""
        places, returned = self.beam.places, self.beam.returned
        return {
            "places": quantities(
                {
                    "leg": ([p.leg for p in places], ""),
                    "name": ([p.name for p in places], ""),
                    "way": ([p.way for p in places], "m"),
                    "radius": ([p.radius for p in places], "m"),
                    "aperture": ([p.aperture for p in places], "m"),
                    "clipped": ([p.clipped for p in places], ""),
                    "power": ([p.power for p in places], "W"),
                }
            ),
            "returned": quantities(
                {
                    "distance": ([r.distance for r in returned], "m"),
                    "hit": ([r.hit for r in returned], ""),
                    "collected": ([r.collected for r in returned], ""),
                    "power": ([r.power for r in returned], "W"),
                    "status": ([r.status for r in returned], ""),
                }
            ),
        }

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the file that was read."""
        return dict(self.hashes)

    def sources(self) -> tuple[Path, ...]:
        """The beam's file, which `save` must not write over."""
        return (self.source,)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye beam --out`."""
        from catseye.gateways.optics.beam_figures import write_beam

        write_beam(self.beam, directory, dict(self.hashes), progress)


@with_units
def beam(file: "str | os.PathLike[str]", *, distance_m: Annotated[Any, In("m", one=True)] = None) -> BeamResult:
    """Sizes, clipping and power of a beam, laser to detector.

    file         record of the beam's elements, laser to detector (docs/formats/beam.md)
    distance_m   to the reflector, m; None: that of the file

    Raises InputError: an invalid record; ArgumentError: a distance outside 0.01 to 1e6 m.
    """
    from catseye.reduction.optics.beam import read_beam

    if distance_m is not None and not DISTANCES[0] <= distance_m <= DISTANCES[1]:
        low, high = DISTANCES
        raise ArgumentError(f"distance_m = {distance_m} is not within {low:g} to {high:g} m", "distance_m")
    source = place_of(file)
    path, hashes = read_beam(source, distance_m)
    return BeamResult(path.verdict, path, source, hashes)
