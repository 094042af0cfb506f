"""mirrors/ZPnnn.toml: what the laboratory knows of a ranger's head and mirror."""

from typing import Annotated

from pydantic import model_validator

from catseye.constants import TWO_PI
from catseye.records.record import Certificate, Name, Uncertainty, Version, Within, broken_rule

Counts = Annotated[int, Within(-1_000_000, 1_000_000)]  # 100 000 a turn
Offset = Annotated[float, Within(-100, 100)]
Tilt = Annotated[float, Within(-0.1, 0.1)]
PositiveVolts = Annotated[float, Within(0, 10, above=True)]


class Mirror(Certificate):
    """A laser head with its mirror.

    leakage_amplitude_volt, leakage_phase_rad, u_leakage_volt   the phasor that leaks into every shot
    d0_mm               from the scan point to the internal reference cube, with u_d0_mm
    dx_mm, dy_mm, dz_mm scan point from the Kelvin fixed point, mount's axes, with u_offset_mm each
    beta1_rad, beta2_rad  small turns about x and y
    na0, ne0            encoder counts at zero; az_low_limit, az_high_limit; azm_zrg, elv_zrg look at the cube
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
