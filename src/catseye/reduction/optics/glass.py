"""Glass at a wavelength and a temperature: indices, slopes, a prism of it, the errors of another glass."""

from collections.abc import Mapping
from dataclasses import dataclass

from catseye.atmosphere.index.air import air
from catseye.constants import DEGREE, MILLIMETRE, SPEED_OF_LIGHT
from catseye.errors import ArgumentError, ValidityError
from catseye.names import NOTES_AIR_MODEL
from catseye.optics.glass import (
    GLASSES,
    Glass,
    absolute_index,
    glass_named,
    group_index,
    group_wavelength,
    phase_index,
    reference_air,
    slopes,
    temperature_slopes,
    wavelength_in_air_um,
)
from catseye.optics.retroreflector import prism
from catseye.optics.retroreflector.back_mirror_cube import BackMirrorCube
from catseye.optics.retroreflector.solid_prism import SolidPrism
from catseye.optics.retroreflector.warm_prism import EXPANSION_C, warm_prism, warm_prism_slopes
from catseye.signal.cycles.whole import glass_phase
from catseye.verdict import Verdict

MODULATION_HZ = 1.5e9  # the GBT's
AIR = (20.0, 933.0, 50.0)  # °C, hPa, %: of the notes' example, [PARKER04] eq. 1.49, by their model
OBLIQUE = 30.0 * DEGREE  # incidence of the reported range change
ALL_GLASSES = Verdict("good", "the makers' formulas, each with its source and limits")
APERTURE = 2.0 / 3.0  # of a prism, over its height, 25.4 of 38.1 mm; no range depends on it
HEIGHTS_MM = (1.0, 1000.0)  # of a prism: metres typed as millimetres are below


@dataclass(frozen=True)
class GlassPrism:
    """Prism of a glass in air; metres, slopes by °C.

    air                      of the notes' example, in words, with its indices
    height                   at 20 °C, face to corner
    range_constant           range through it less the geometric one to its point of reference
    reference_depth          point of reference below the face
    flat_depth               point below the face about which a small turn leaves the range as it is
    range_change_at_30_deg   of the range at that incidence
    notes_...                by the notes, with the index relative to vacuum
    phase_offset             phi_ic of the range constant at 1500 MHz in that air, rad
    """

    air: str
    air_phase_index: float
    air_group_index: float
    height: float
    height_at_temperature: float
    phase_index_over_air: float
    group_index_over_air: float
    notes_group_index_over_air: float
    range_constant: float
    range_constant_per_c: float
    reference_depth: float
    reference_depth_per_c: float
    flat_depth: float
    range_change_at_30_deg: float
    notes_range_constant: float
    phase_offset: float
    notes_phase_offset: float


@dataclass(frozen=True)
class GlassBehindMirror:
    """Prism in the back of a mirror, seen from behind; metres.

    thickness                from the mirror's face to the prism's
    range_constant           from the measured length to the mirror's face
    change_at_30_deg         of the constant at that incidence: added to it, it is right there
    notes_range_constant     by the notes, with the index relative to vacuum
    """

    thickness: float
    range_constant: float
    change_at_30_deg: float
    notes_range_constant: float


@dataclass(frozen=True)
class GlassExchange:
    """Errors of assuming another glass: indices, and a range, m."""

    phase_index: float
    group_index: float
    range_too_long_about_point: float
    range_too_long_about_face: float


@dataclass(frozen=True)
class GlassState:
    """Glass at a wavelength and a temperature.

    name, glass           of `catseye.optics.glass.GLASSES`
    wavelength_um         in vacuum; wavelength_in_air_um in the makers' reference air
    phase_index, group_index   relative to that air, with slopes by um
    group_wavelength      of the modulation in it, m
    notes_...             with the vacuum wavelength taken as in air
    absolute_...          relative to vacuum at the temperature, with slopes by °C
    prism                 of the glass, in air
    others                errors of assuming another glass, by name; None where its formula is not valid
    plate                 prism in the back of a mirror; None without one
    """

    name: str
    glass: Glass
    wavelength_um: float
    wavelength_in_air_um: float
    temperature_c: float
    phase_index: float
    group_index: float
    phase_index_per_um: float
    group_index_per_um: float
    group_wavelength: float
    notes_phase_index: float
    notes_group_index: float
    notes_group_wavelength: float
    absolute_phase_index: float
    absolute_group_index: float
    absolute_phase_index_per_c: float
    absolute_group_index_per_c: float
    prism: GlassPrism
    others: Mapping[str, GlassExchange | None]
    plate: GlassBehindMirror | None

    @property
    def verdict(self) -> Verdict:
        """Good within the formulas' limits, doubtful beyond those of the expansion."""
        low, high = EXPANSION_C
        if not low <= self.temperature_c <= high:
            limits = f"{self.temperature_c:g} °C is outside {low:g} to {high:g} °C"
            return Verdict("doubtful", f"{limits}, for which the expansion of {self.name} is stated")
        return Verdict("good", f"within the limits of {self.name}'s dispersion formula, {self.glass.source}")


def glass_state(
    name: str, wavelength_um: float, temperature_c: float, *, height_mm: float, plate_mm: float | None = None
) -> GlassState:
    """Glass at a wavelength and a temperature.

    name            in GLASSES
    wavelength_um   in vacuum, um
    temperature_c   °C, of the glass
    height_mm       height of a prism at 20 °C, mm
    plate_mm        from a mirror's face to that of the prism in its back, mm; None: no mirror

    Raises ValidityError: unknown glass, a value outside its formula; ArgumentError: no height of a prism.
    Source: the glass's own; `catseye.optics.glass`, `catseye.optics.retroreflector.warm_prism`.

    >>> round(float(glass_state("BK7-old", 0.78, 20.0, height_mm=38.4).notes_group_index), 8)
    1.52746375
    """
    require_height(height_mm)
    glass = glass_named(name)
    vacuum = absolute_index(wavelength_um, name, temperature_c)
    wavelength = float(wavelength_in_air_um(wavelength_um, name))
    by_wavelength, by_temperature = slopes(wavelength, name), temperature_slopes(wavelength_um, name, temperature_c)
    height = height_mm * MILLIMETRE
    words, air_phase, air_group = _surrounding_air(wavelength_um)
    body = _prism((height, name, wavelength_um, temperature_c), words, air_phase, air_group)
    return GlassState(
        name=name,
        glass=glass,
        wavelength_um=wavelength_um,
        wavelength_in_air_um=wavelength,
        temperature_c=temperature_c,
        phase_index=float(phase_index(wavelength, name)),
        group_index=float(group_index(wavelength, name)),
        phase_index_per_um=float(by_wavelength.phase),
        group_index_per_um=float(by_wavelength.group),
        group_wavelength=float(group_wavelength(MODULATION_HZ, wavelength, name)),
        notes_phase_index=float(phase_index(wavelength_um, name)),
        notes_group_index=float(group_index(wavelength_um, name)),
        notes_group_wavelength=float(group_wavelength(MODULATION_HZ, wavelength_um, name)),
        absolute_phase_index=float(vacuum.phase),
        absolute_group_index=float(vacuum.group),
        absolute_phase_index_per_c=float(by_temperature.phase),
        absolute_group_index_per_c=float(by_temperature.group),
        prism=body,
        others={other: _exchange(other, name, wavelength_um, height, air_group) for other in GLASSES if other != name},
        plate=None if plate_mm is None else _behind_mirror(body, plate_mm),
    )


def require_height(height_mm: float) -> None:
    """Raise ArgumentError where a height cannot be a prism's."""
    low, high = HEIGHTS_MM
    if not low <= height_mm <= high:
        text = f"height_mm = {height_mm} is not a prism's height (expected {low:g} to {high:g})"
        raise ArgumentError(text, "height_mm")


def _surrounding_air(wavelength_um: float) -> tuple[str, float, float]:
    """Air of the notes' example: words, phase and group index.

    The makers' reference air is taken where the notes' model is not valid.
    """
    try:
        about = air(*AIR, wavelength_um=wavelength_um, model=NOTES_AIR_MODEL)
    except ValidityError:
        phase, group = reference_air(wavelength_um, AIR[0])
        return "20 °C, 1013.25 hPa, dry", float(phase), float(group)
    return "20 °C, 933 hPa, 50 %", float(about.phase_index), float(about.group_index)


def _prism(state: tuple[float, str, float, float], words: str, air_phase: float, air_group: float) -> GlassPrism:
    """Prism at its temperature in the surrounding air.

    state   height at 20 °C, glass, vacuum wavelength um, temperature °C
    """
    height, name, wavelength_um, _ = state
    warm = warm_prism(*state, air_phase=air_phase, air_group=air_group)
    per_c = warm_prism_slopes(*state, air_phase=air_phase, air_group=air_group)
    notes = float(group_index(wavelength_um, name)) / air_group
    half = SPEED_OF_LIGHT / (2.0 * MODULATION_HZ * air_group)
    return GlassPrism(
        air=words,
        air_phase_index=air_phase,
        air_group_index=air_group,
        height=height,
        height_at_temperature=float(warm.height),
        phase_index_over_air=float(warm.phase),
        group_index_over_air=float(warm.group),
        notes_group_index_over_air=notes,
        range_constant=float(warm.range_constant),
        range_constant_per_c=float(per_c.range_constant),
        reference_depth=float(warm.reference_depth),
        reference_depth_per_c=float(per_c.reference_depth),
        flat_depth=float(prism.flat_depth(warm.height, group=warm.group, phase=warm.phase)),
        range_change_at_30_deg=float(prism.oblique_change(warm.height, OBLIQUE, group=warm.group, phase=warm.phase)),
        notes_range_constant=float(prism.range_constant(height, notes)),
        phase_offset=float(glass_phase(warm.range_constant, half)),
        notes_phase_offset=float(glass_phase(prism.range_constant(height, notes), half)),
    )


def _behind_mirror(body: GlassPrism, plate_mm: float) -> GlassBehindMirror:
    """Prism set in the back of a mirror.

    plate_mm   from the mirror's face to the prism's, mm

    Raises ArgumentError: no plate. Source: [PARKER04] section 2.4, eq. 2.24, for the arrangement.
    """
    low, high = HEIGHTS_MM
    if not low <= plate_mm <= high:
        text = f"plate_mm = {plate_mm} is not the thickness of a mirror's plate (expected {low:g} to {high:g})"
        raise ArgumentError(text, "plate_mm")
    cube = SolidPrism(
        height=body.height_at_temperature,
        aperture=APERTURE * body.height_at_temperature,
        group=body.group_index_over_air,
        phase=body.phase_index_over_air,
    )
    back = BackMirrorCube(cube, setback=(0.0, 0.0, plate_mm * MILLIMETRE))
    return GlassBehindMirror(
        thickness=plate_mm * MILLIMETRE,
        range_constant=float(back.range_constant),
        change_at_30_deg=float(back.range_change(OBLIQUE)),
        notes_range_constant=plate_mm * MILLIMETRE - body.notes_group_index_over_air * body.height,
    )


def _exchange(assumed: str, name: str, wavelength_um: float, height: float, air_group: float) -> GlassExchange | None:
    """Errors of assuming another glass; None where its formula is not valid."""
    glass = GLASSES[assumed]
    in_air = {which: float(wavelength_in_air_um(wavelength_um, which)) for which in (name, assumed)}
    if not glass.shortest_um <= in_air[assumed] <= glass.longest_um:
        return None
    n, m = (float(group_index(um, which)) / air_group for which, um in in_air.items())
    wrong = prism.wrong_glass(height, assumed=n, true=m)
    return GlassExchange(
        phase_index=float(phase_index(in_air[assumed], assumed) - phase_index(in_air[name], name)),
        group_index=float(group_index(in_air[assumed], assumed) - group_index(in_air[name], name)),
        range_too_long_about_point=float(wrong.about_point),
        range_too_long_about_face=float(wrong.about_face),
    )
