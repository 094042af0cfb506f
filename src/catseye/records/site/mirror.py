"""mirrors/ZPnnn.toml: laboratory calibration of a ranger's head and mirror."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from catseye.constants import TWO_PI
from catseye.records.files.record import Certificate, Name, Record, Uncertainty, Version, Within, broken_rule

Counts = Annotated[int, Within(-1_000_000, 1_000_000)]  # 100 000 per turn
Zero = Annotated[int | float, Within(-1_000_000, 1_000_000)]  # counts; a calibration gives fractions
FewCounts = Annotated[float, Within(-1000, 1000)]  # largest encoder error: 1000 are 3.6 degrees
Offset = Annotated[float, Within(-100, 100)]
Tilt = Annotated[float, Within(-0.1, 0.1)]
PositiveVolts = Annotated[float, Within(0, 10, above=True)]
AxisOffset = Annotated[float, Within(-10, 10)]  # mm
Cycle = Annotated[float, Within(-1, 1)]  # mm
PerVolt = Annotated[float, Within(-0.05, 0.05)]  # 1/V: ten volts are half the light
SmallTilt = Annotated[float, Within(-0.05, 0.05)]
UncertainTilt = Annotated[float, Within(0, 0.05, above=True)]
UncertainCounts = Annotated[float, Within(0, 1000, above=True)]
Orders = Annotated[tuple[FewCounts, ...], Field(strict=False, max_length=8)]
Part = int | Annotated[str, Field(min_length=1)]  # a serial number
Setting = Annotated[int, Within(0, 2**30 - 1)]  # of the motion chip
Gain = Annotated[int, Within(0, 32_767)]
Interval = Annotated[int, Within(0, 255)]
CountLimit = Annotated[int, Within(0, 25_000)]

UNCERTAIN = (
    (("axis_offset_mm", "mirror_offset_mm", "beam_x_mm", "beam_y_mm"), "u_axis_mm"),
    (("amplitude_to_phase_rad",), "u_amplitude_to_phase_rad"),
    (("cyclic_cosine_mm", "cyclic_sine_mm"), "u_cyclic_mm"),
    (("second_pass_cosine_per_volt", "second_pass_sine_per_volt"), "u_second_pass_per_volt"),
    (("detector_lag_rad", "image_offset_um"), "u_image_um"),
    (("azimuth_encoder_cosine_counts", "azimuth_encoder_sine_counts"), "u_encoder_counts"),
    (("elevation_encoder_cosine_counts", "elevation_encoder_sine_counts"), "u_encoder_counts"),
    (("face_tilt_rad", "beam_tilt_x_rad", "beam_tilt_y_rad"), "u_tilt_rad"),
)
PAIRED = (
    ("cyclic_cosine_mm", "cyclic_sine_mm"),
    ("azimuth_encoder_cosine_counts", "azimuth_encoder_sine_counts"),
    ("elevation_encoder_cosine_counts", "elevation_encoder_sine_counts"),
)


class HeadFrequency(Record):
    """[[frequency]]: a further modulation frequency of the head, beside that of site.toml.

    modulation_hz                              frequency of the modulation
    leakage_amplitude_volt, leakage_phase_rad  amplitude and phase of the leakage at it
    u_leakage_volt                             of each quadrature of the leakage
    """

    modulation_hz: Annotated[float, Within(1e6, 1e11)]
    leakage_amplitude_volt: Annotated[float, Within(0, 10)]
    leakage_phase_rad: Annotated[float, Within(-TWO_PI, TWO_PI)]
    u_leakage_volt: PositiveVolts


class MirrorGeometry(Certificate):
    """Mirror data required for pointing; ranging data may be missing.

    zp                                 name of the mirror
    laser_number, detector_number      parts of the head
    head_number, oscillator_number     parts of the head
    leakage_amplitude_volt, leakage_phase_rad  amplitude and phase of the leakage, subtracted from every shot's phasor
    u_leakage_volt                     of each quadrature of the leakage
    d0_mm                              straight distance from the scan point to the internal reference cube
    dx_mm, dy_mm, dz_mm                scan point from the Kelvin fixed point, mount's axes
    u_offset_mm                        of each of dx_mm, dy_mm and dz_mm
    beta1_rad, beta2_rad               small rotations of the mirror's axes about x and y of the mount
    u_beta_rad                         of each of beta1_rad and beta2_rad
    axis_offset_mm                     elevation axis from the azimuth axis, positive along the azimuth of the beam
    mirror_offset_mm                   reflecting face from the elevation axis, positive along its outward normal
    beam_x_mm, beam_y_mm               laser beam from the azimuth axis where it meets the mirror, mirror's axes at
                                       Theta = 0
    u_axis_mm                          of each of axis_offset_mm, mirror_offset_mm, beam_x_mm and beam_y_mm
    face_tilt_rad                      tilt of the face's outward normal from the plane across the elevation axis,
                                       towards the axis's y end (y of the mirror's axes at Theta = 0)
    beam_tilt_x_rad, beam_tilt_y_rad   x and y of the direction opposite to the incoming laser beam; z is nearly 1
    u_tilt_rad                         of each of face_tilt_rad, beam_tilt_x_rad and beam_tilt_y_rad
    detector_defocus_mm                defocus of the detector, for information only
    beam_divergence_rad                divergence of the beam, for information only
    amplitude_to_phase_rad             increase of the measured phase per factor e of amplitude above that of the
                                       reference shots
    cyclic_cosine_mm, cyclic_sine_mm   terms of the range error (positive: too long), orders 1, 2, ... of the phase
                                       after the electronics'
    u_cyclic_mm                        of each cyclic term; without terms it stands for orders 1 and 2, expected zero
    second_pass_cosine_per_volt, second_pass_sine_per_volt  light that the detector sends out again: turn of the phase
                                       for each volt of return, range too long, of the cosine and sine of the phase
                                       after the electronics'
    u_second_pass_per_volt             of each of both
    u_feedback_rad                     of the phase of one shot by light back into the laser, by itself
    detector_radius_mm                 radius of the detector's active disc
    detector_lag_rad                   phase by which the signal of the disc's centre is later than that of its rim
    image_offset_um                    mean place of the images from the centre of the disc
    u_image_um                         of each coordinate of one shot's image about the mean place, by itself
    na0, ne0                           encoder counts of azimuth and elevation at zero
    u_zero_counts                      of each of `na0` and `ne0`
    azimuth_encoder_cosine_counts, azimuth_encoder_sine_counts  orders 1, 2, ... of the encoder's error, positive if
                                       it reads too high: waves of the axis's angle from its zero
    elevation_encoder_cosine_counts, elevation_encoder_sine_counts  the same of the elevation encoder, in the
                                       mirror's own angle, half of Phi
    u_encoder_counts                   of each term of both encoders' errors
    az_low_limit, az_high_limit        counts of the azimuth stops, both allowed
    azm_zrg, elv_zrg                   counts that point at the internal cube
    abv_0, abv_1                       greatest velocity of axis 0 (azimuth) and 1 (elevation), integers of the
                                       motion chip: counts a sample times 65 536
    aba_0, aba_1                       acceleration of each axis, counts a sample squared times 65 536
    fkp_0, fkp_1                       proportional gain of the servo
    fki_0, fki_1                       integral gain of the servo
    fkd_0, fkd_1                       derivative gain of the servo
    fil_0, fil_1                       limit of the integral
    fsi_0, fsi_1                       interval of the derivative, samples
    erl_0, erl_1                       greatest following error, counts
    notes                              NOTES of the report
    """

    format: Annotated[int | str, Version("mirror")] = 1
    zp: Name
    laser_number: Part | None = None
    detector_number: Part | None = None
    head_number: Part | None = None
    oscillator_number: Part | None = None
    leakage_amplitude_volt: Annotated[float, Within(0, 10)] | None = None
    leakage_phase_rad: Annotated[float, Within(-TWO_PI, TWO_PI)] | None = None
    u_leakage_volt: PositiveVolts | None = None
    d0_mm: Annotated[float, Within(50, 1000)] | None = None
    u_d0_mm: Uncertainty | None = None
    dx_mm: Offset
    dy_mm: Annotated[float, Within(50, 1000)]
    dz_mm: Offset
    u_offset_mm: Uncertainty | None = None
    beta1_rad: Tilt
    beta2_rad: Tilt
    u_beta_rad: UncertainTilt | None = None
    axis_offset_mm: AxisOffset = 0.0
    mirror_offset_mm: AxisOffset = 0.0
    beam_x_mm: AxisOffset = 0.0
    beam_y_mm: AxisOffset = 0.0
    u_axis_mm: Uncertainty | None = None
    face_tilt_rad: SmallTilt = 0.0
    beam_tilt_x_rad: SmallTilt = 0.0
    beam_tilt_y_rad: SmallTilt = 0.0
    u_tilt_rad: UncertainTilt | None = None
    detector_defocus_mm: Annotated[float, Within(-100, 100)] | None = None
    u_detector_defocus_mm: Uncertainty | None = None
    beam_divergence_rad: Annotated[float, Within(0, 0.1)] | None = None
    u_beam_divergence_rad: Annotated[float, Within(0, 0.1, above=True)] | None = None
    amplitude_to_phase_rad: Annotated[float, Within(-0.1, 0.1)] = 0.0
    u_amplitude_to_phase_rad: Annotated[float, Within(0, 0.1, above=True)] | None = None
    cyclic_cosine_mm: Annotated[tuple[Cycle, ...], Field(strict=False, max_length=8)] = ()
    cyclic_sine_mm: Annotated[tuple[Cycle, ...], Field(strict=False, max_length=8)] = ()
    u_cyclic_mm: Uncertainty | None = None
    second_pass_cosine_per_volt: PerVolt = 0.0
    second_pass_sine_per_volt: PerVolt = 0.0
    u_second_pass_per_volt: Annotated[float, Within(0, 0.1, above=True)] | None = None
    u_feedback_rad: Annotated[float, Within(0, 0.1, above=True)] | None = None
    detector_radius_mm: Annotated[float, Within(1e-3, 50)] | None = None
    detector_lag_rad: Annotated[float, Within(-0.5, 0.5)] = 0.0
    image_offset_um: Annotated[float, Within(0, 50_000)] = 0.0
    u_image_um: Annotated[float, Within(0, 1000, above=True)] | None = None
    na0: Zero
    ne0: Zero
    u_zero_counts: UncertainCounts | None = None
    azimuth_encoder_cosine_counts: Orders = ()
    azimuth_encoder_sine_counts: Orders = ()
    elevation_encoder_cosine_counts: Orders = ()
    elevation_encoder_sine_counts: Orders = ()
    u_encoder_counts: UncertainCounts | None = None
    az_low_limit: Counts
    az_high_limit: Counts
    azm_zrg: Counts | None = None
    elv_zrg: Counts | None = None
    abv_0: Setting | None = None
    aba_0: Setting | None = None
    fkp_0: Gain | None = None
    fki_0: Gain | None = None
    fkd_0: Gain | None = None
    fil_0: Gain | None = None
    fsi_0: Interval | None = None
    erl_0: CountLimit | None = None
    abv_1: Setting | None = None
    aba_1: Setting | None = None
    fkp_1: Gain | None = None
    fki_1: Gain | None = None
    fkd_1: Gain | None = None
    fil_1: Gain | None = None
    fsi_1: Interval | None = None
    erl_1: CountLimit | None = None
    notes: Annotated[str, Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _has_room_between_its_limits(self) -> Self:
        if self.az_low_limit >= self.az_high_limit:
            low, high = self.az_low_limit, self.az_high_limit
            raise broken_rule(f"az_low_limit = {low} is not below az_high_limit = {high} (expected low < high)")
        return self

    @model_validator(mode="after")
    def _says_how_well_it_knows_its_effects(self) -> Self:
        for keys, u in UNCERTAIN:
            for key in keys:
                value = getattr(self, key)
                terms = value if isinstance(value, tuple) else (value,)
                if any(terms) and getattr(self, u) is None:
                    text = list(value) if isinstance(value, tuple) else value
                    raise broken_rule(f"{key} = {text} has no {u} (expected its standard uncertainty)")
        return self

    @model_validator(mode="after")
    def _has_its_images_on_the_detector(self) -> Self:
        keys = sorted(("detector_radius_mm", "u_image_um"), key=lambda key: getattr(self, key) is not None)
        if (self.u_image_um is None) != (self.detector_radius_mm is None):
            raise broken_rule(f"{keys[0]} is missing beside {keys[1]} (expected both or none)")
        reach = self.image_offset_um + 3.0 * (self.u_image_um or 0.0)
        if self.detector_radius_mm is not None and reach > self.detector_radius_mm * 1e3:
            raise broken_rule(
                f"image_offset_um + 3 u_image_um = {reach:g} um is beyond the disc (expected up to "
                f"{self.detector_radius_mm * 1e3:g}, by detector_radius_mm)"
            )
        return self

    @model_validator(mode="after")
    def _has_a_sine_for_each_cosine(self) -> Self:
        for cosine, sine in PAIRED:
            cosines, sines = len(getattr(self, cosine)), len(getattr(self, sine))
            if cosines != sines:
                raise broken_rule(f"{cosine} has {cosines} orders, {sine} {sines} (expected as many of each)")
        return self

    @model_validator(mode="after")
    def _accelerates_no_faster_than_it_moves(self) -> Self:
        for axis in (0, 1):
            velocity, acceleration = getattr(self, f"abv_{axis}"), getattr(self, f"aba_{axis}")
            if velocity is not None and acceleration is not None and velocity < acceleration:
                raise broken_rule(
                    f"abv_{axis} = {velocity} is below aba_{axis} = {acceleration} (expected no less: the motion chip "
                    "would pass its velocity in the first sample)"
                )
        return self


class Mirror(MirrorGeometry):
    """Laser head with its mirror, complete for ranging; other keys are in `MirrorGeometry`.

    leakage_amplitude_volt, leakage_phase_rad  amplitude and phase of the leakage, subtracted from every shot's phasor
    d0_mm               straight distance from the scan point to the internal reference cube, with u_d0_mm
    amplitude_to_phase_rad  increase of the measured phase per factor e of amplitude above that of the reference
                        shots, with u_amplitude_to_phase_rad
    cyclic_cosine_mm, cyclic_sine_mm  terms of the range error (positive: too long), orders 1, 2, ... of the phase after
                        the electronics', with u_cyclic_mm of each; without terms it stands for orders 1 and 2
    azm_zrg, elv_zrg    counts that point at the cube
    frequency           further modulation frequencies, each with its leakage; D0 is a length, the same at all

    The scan point is where the axes should meet: on the azimuth axis, nearest to the elevation axis. D0 is a distance
    between two points; the effect of offsets on the path to the cube, at azm_zrg and elv_zrg, is not included.
    """

    leakage_amplitude_volt: Annotated[float, Within(0, 10)]
    leakage_phase_rad: Annotated[float, Within(-TWO_PI, TWO_PI)]
    u_leakage_volt: PositiveVolts
    d0_mm: Annotated[float, Within(50, 1000)]
    u_d0_mm: Uncertainty
    u_offset_mm: Uncertainty
    azm_zrg: Counts
    elv_zrg: Counts
    frequency: Annotated[tuple[HeadFrequency, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _has_each_frequency_once(self) -> Self:
        modulations = [further.modulation_hz for further in self.frequency]
        for hz in modulations:
            if modulations.count(hz) > 1:
                raise broken_rule(f"frequency: modulation_hz = {hz:.10g} is given twice (expected each once)")
        return self

    def at_modulation(self, modulation_hz: float) -> Self:
        """Sheet with the leakage at one of its frequencies; unchanged at the site's."""
        for further in self.frequency:
            if further.modulation_hz == modulation_hz:
                return self.model_copy(update=further.model_dump(exclude={"modulation_hz"}))
        return self
