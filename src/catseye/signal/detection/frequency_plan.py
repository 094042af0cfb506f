"""Ranger frequencies: scale, sign and ambiguity of the phase."""

import math
from dataclasses import dataclass
from numbers import Integral
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import PPM, SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.signal.cycles.whole import fraction


@dataclass(frozen=True)
class FrequencyPlan:
    """Laser modulation and local oscillator: scale and sign of phase.

    reference_hz    Hz, above 0: the station's frequency standard
    multiple        whole number, at least 1: modulation = multiple x reference
    oscillator      the local oscillator lies "above" or "below" the modulation by the intermediate frequency (IF)

    The sign. Light modulated at f returns after tau: cos 2 pi f (t - tau). The oscillator, f + F or f - F with F the
    IF, multiplies it; the mixer's filter keeps the difference of the arguments. Above: cos(2 pi F t + 2 pi f tau).
    Below: cos(-2 pi F t + 2 pi f tau) = cos(2 pi F t - 2 pi f tau). Beside s_j = A cos(2 pi j/n - phi), j/n = F t:
    above, phi = -2 pi f tau falls as the distance grows (eq. 5.9, which the notes found by trial); below, phi = +2 pi f
    tau grows. Constant phases of the electronics join 2 pi f tau and change sign with it.

    The notes contradict themselves: 5.1.1 mixes with 1500.000 MHz + IF, 5.1.3 with 1500.000 MHz. That frequency mixed
    with itself gives a steady voltage, no IF; were the laser at 1500 MHz + IF instead, the oscillator would be below
    and the phase would grow, against 5.3. Only 5.1.1 can be right. 5.9 prints -2 pi/lambda/2; -2 pi/(lambda/2) is
    meant.

    Raises ValidityError for values outside those limits. Source: [PARKER04] section 5.1.1, eq. 5.9 and 5.10.

    >>> plan = FrequencyPlan()
    >>> plan.modulation_hz, plan.local_oscillator_hz(1000.0), plan.phase_sign
    (1500000000.0, 1500001000.0, -1)
    >>> round(plan.half_wavelength(1.000253246815), 6), round(FrequencyPlan(oscillator="below").phase_gradient(), 3)
    (0.099906, 62.875)
    """

    reference_hz: float = 100e6
    multiple: int = 15
    oscillator: Literal["above", "below"] = "above"

    def __post_init__(self) -> None:
        if not 0.0 < self.reference_hz < math.inf:
            raise ValidityError(f"reference frequency {self.reference_hz} Hz is not above 0 and finite")
        object.__setattr__(self, "multiple", whole_number("multiple of the reference", self.multiple, at_least=1))
        if self.oscillator not in ("above", "below"):
            raise ValidityError(f"local oscillator '{self.oscillator}' is neither 'above' nor 'below' the modulation")

    @property
    def modulation_hz(self) -> float:
        """Modulation frequency of the laser, Hz."""
        return self.multiple * self.reference_hz

    @property
    def phase_sign(self) -> int:
        """Sign of d phase/d distance: -1 oscillator above, +1 below."""
        return -1 if self.oscillator == "above" else 1

    def local_oscillator_hz(self, intermediate_hz: float) -> float:
        """Local oscillator, Hz, for an intermediate frequency, Hz."""
        return self.modulation_hz - self.phase_sign * intermediate_hz

    def half_wavelength(self, group_index: float = 1.0) -> float:
        """Half the modulation wavelength, m: the unambiguous range.

        Source: [PARKER04] eq. 5.16.
        """
        return SPEED_OF_LIGHT / (2.0 * group_index * self.modulation_hz)

    def range_per_radian(self, group_index: float = 1.0) -> float:
        """Range per radian of phase, m: lambda/4 pi.

        A magnitude, of [PARKER04] eq. 5.8.
        """
        return self.half_wavelength(group_index) / TWO_PI

    def phase_gradient(self, group_index: float = 1.0) -> float:
        """Phase gradient d phi/d D, rad/m, with its sign.

        Source: [PARKER04] eq. 5.9.
        """
        return self.phase_sign / self.range_per_radian(group_index)

    def phase(self, distance: ArrayLike, group_index: ArrayLike = 1.0) -> NDArray[np.float64]:
        """Phase of the path there and back, rad in [0, 2 pi).

        Without the electronics.

        Source: [PARKER04] eq. 5.11.
        """
        turns = 2.0 * np.multiply(distance, group_index, dtype=float) * self.modulation_hz / SPEED_OF_LIGHT
        return fraction(self.phase_sign * TWO_PI * (turns - np.floor(turns)), 0.0)

    def range_scale_ppm(self, reference_offset_ppm: float = 0.0, modulation_offset_hz: float = 0.0) -> float:
        """Scale error of ranges reduced with the nominal frequency, ppm.

        Positive where ranges are too long; it applies to the difference to the reference cube.

        reference_offset_ppm    ppm, true reference above the nominal one; it moves modulation and oscillator together
        modulation_offset_hz    Hz, of the synthesiser: true modulation above multiple x reference

        Phase is 2 pi f tau with the true f: f too high makes ranges too long. The IF comes from the sampling counter,
        so neither offset disturbs the lock of the samples; one of the oscillator alone does (`beat_hz`).

        >>> FrequencyPlan().range_scale_ppm(0.1), round(FrequencyPlan().range_scale_ppm(modulation_offset_hz=15.0), 6)
        (0.1, 0.01)
        """
        return reference_offset_ppm + modulation_offset_hz / self.modulation_hz / PPM

    def beat_hz(
        self, intermediate_hz: float, *, received_offset_hz: float = 0.0, oscillator_offset_hz: float = 0.0
    ) -> float:
        """Frequency of the mixed signal with offsets, Hz.

        The offsets come from Doppler shift or oscillator.

        intermediate_hz         Hz, the planned IF
        received_offset_hz      Hz, received modulation above the plan's
        oscillator_offset_hz    Hz, oscillator above its plan

        Below zero the sense of phase is reversed. Feed it to `tone_response`.
        """
        return intermediate_hz - self.phase_sign * (oscillator_offset_hz - received_offset_hz)


def whole_number(what: str, value: object, *, at_least: int) -> int:
    """Convert a whole number to int; refuse other values."""
    if isinstance(value, bool) or not isinstance(value, Integral) or int(value) < at_least:
        raise ValidityError(f"{what} {value!r} is not a whole number of at least {at_least}")
    return int(value)
