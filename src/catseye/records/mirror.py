"""mirrors/ZPnnn.toml: what the laboratory knows of a ranger's head and mirror."""

from typing import Annotated

from pydantic import Field, model_validator

from catseye.constants import TWO_PI
from catseye.records.record import Certificate, Name, Uncertainty, Version, Within, broken_rule

Counts = Annotated[int, Within(-1_000_000, 1_000_000)]  # 100 000 a turn
Offset = Annotated[float, Within(-100, 100)]
Tilt = Annotated[float, Within(-0.1, 0.1)]
PositiveVolts = Annotated[float, Within(0, 10, above=True)]
AxisOffset = Annotated[float, Within(-10, 10)]  # mm
Cycle = Annotated[float, Within(-1, 1)]  # mm


UNCERTAIN = (
    (("axis_offset_mm", "mirror_offset_mm", "beam_x_mm", "beam_y_mm"), "u_axis_mm"),
    (("amplitude_to_phase_rad",), "u_amplitude_to_phase_rad"),
    (("cyclic_cosine_mm", "cyclic_sine_mm"), "u_cyclic_mm"),
)


class Mirror(Certificate):
    """A laser head with its mirror.

    leakage_amplitude_volt, leakage_phase_rad, u_leakage_volt   the phasor that leaks into every shot
    d0_mm               straight from the scan point to the internal reference cube, with u_d0_mm
    dx_mm, dy_mm, dz_mm scan point from the Kelvin fixed point, mount's axes, with u_offset_mm each
    beta1_rad, beta2_rad  small turns about x and y
    axis_offset_mm      elevation axis from the azimuth axis, above zero along the azimuth of the beam
    mirror_offset_mm    reflecting face from the elevation axis, above zero along its outward normal
    beam_x_mm, beam_y_mm  laser beam from the azimuth axis where it meets the mirror, mirror's axes at Theta = 0
    u_axis_mm           of each of these four
    amplitude_to_phase_rad  growth of the measured phase for each factor e of amplitude above that of the reference
                        shots, with u_amplitude_to_phase_rad
    cyclic_cosine_mm, cyclic_sine_mm  of the range read too long, orders 1, 2, ... of the phase after the electronics',
                        with u_cyclic_mm of each; u_cyclic_mm alone means orders 1 and 2, expected zero
    na0, ne0            encoder counts at zero; az_low_limit, az_high_limit; azm_zrg, elv_zrg look at the cube

    The scan point is where the axes should meet: on the azimuth axis, nearest to the elevation axis. D0 is a distance
    between two points; what offsets add to the way to the cube, at the angles of azm_zrg and elv_zrg, is not in it.
    """

    format: Annotated[int | str, Version("mirror")] = 1
    zp: Name
    leakage_amplitude_volt: Annotated[float, Within(0, 10)]
    leakage_phase_rad: Annotated[float, Within(-TWO_PI, TWO_PI)]
    u_leakage_volt: PositiveVolts
    d0_mm: Annotated[float, Within(50, 1000)]
    u_d0_mm: Uncertainty
    dx_mm: Offset
    dy_mm: Annotated[float, Within(50, 1000)]
    dz_mm: Offset
    u_offset_mm: Uncertainty
    beta1_rad: Tilt
    beta2_rad: Tilt
    axis_offset_mm: AxisOffset = 0.0
    mirror_offset_mm: AxisOffset = 0.0
    beam_x_mm: AxisOffset = 0.0
    beam_y_mm: AxisOffset = 0.0
    u_axis_mm: Uncertainty | None = None
    amplitude_to_phase_rad: Annotated[float, Within(-0.1, 0.1)] = 0.0
    u_amplitude_to_phase_rad: Annotated[float, Within(0, 0.1, above=True)] | None = None
    cyclic_cosine_mm: Annotated[tuple[Cycle, ...], Field(strict=False, max_length=8)] = ()
    cyclic_sine_mm: Annotated[tuple[Cycle, ...], Field(strict=False, max_length=8)] = ()
    u_cyclic_mm: Uncertainty | None = None
    na0: Counts
    ne0: Counts
    az_low_limit: Counts
    az_high_limit: Counts
    azm_zrg: Counts
    elv_zrg: Counts

    @model_validator(mode="after")
    def _has_room_between_its_limits(self) -> "Mirror":
        if self.az_low_limit >= self.az_high_limit:
            low, high = self.az_low_limit, self.az_high_limit
            raise broken_rule(f"az_low_limit = {low} is not below az_high_limit = {high} (expected low < high)")
        return self

    @model_validator(mode="after")
    def _says_how_well_it_knows_its_effects(self) -> "Mirror":
        for keys, u in UNCERTAIN:
            for key in keys:
                value = getattr(self, key)
                terms = value if isinstance(value, tuple) else (value,)
                if any(terms) and getattr(self, u) is None:
                    shown = list(value) if isinstance(value, tuple) else value
                    raise broken_rule(f"{key} = {shown} has no {u} (expected its standard uncertainty)")
        return self

    @model_validator(mode="after")
    def _has_a_sine_for_each_cosine(self) -> "Mirror":
        cosines, sines = len(self.cyclic_cosine_mm), len(self.cyclic_sine_mm)
        if cosines != sines:
            raise broken_rule(
                f"cyclic_cosine_mm has {cosines} orders, cyclic_sine_mm {sines} (expected as many of each)"
            )
        return self
