"""Head, optics and retroreflector for a link budget."""

import math
from dataclasses import dataclass, replace

from catseye.errors import ValidityError


@dataclass(frozen=True)
class Link:
    """Head and its optics.

    The defaults are a plausible head of the 1990s, not a measured one: set your own.

    power                 W, mean, of the laser; the notes' reference [78] has 10 mW
    depth                 modulation depth of the light
    wavelength            m, of the light
    modulation_hz         Hz
    waist                 m, radius of the outgoing beam at 1/e^2, at the head
    receiver              m, radius of the receiving lens
    transmission          of all surfaces of the head, out and back together; a splitter counts twice
    responsivity          A/W at the modulation frequency
    amplifier             A/sqrt(Hz), input noise
    intensity_noise_db_hz dB/Hz, of the laser near the modulation
    volts_per_ampere      V at the converter for each A of signal current; from a measured return, see `scaled`
    blocked_noise_volt    V, rms of the samples with the beam blocked, noise not from light: oscillators, mixer,
                          amplifiers after it; night-01's heads show 0.17 to 0.25 V
    full_scale_volt       V, largest input of the converter
    samples_per_second    of the converter; with `bits` its rounding
    duration              s, of one range
    crosstalk             amplitude of the residual leakage within the head relative to a 1 V return
    extinction_per_m      1/m, of the air
    """

    power: float = 10e-3
    depth: float = 0.5
    wavelength: float = 0.78e-6
    modulation_hz: float = 1500e6
    waist: float = 10e-3
    receiver: float = 50e-3
    transmission: float = 0.15
    responsivity: float = 0.45
    amplifier: float = 15e-12
    intensity_noise_db_hz: float = -140.0
    volts_per_ampere: float = 2.5e4
    blocked_noise_volt: float = 0.2
    full_scale_volt: float = 10.0
    bits: int = 16
    samples_per_second: float = 64_000.0
    duration: float = 0.128
    crosstalk: float = 1e-3
    extinction_per_m: float = 1e-5

    def scaled(self, computed_volt: float, measured_volt: float) -> "Link":
        """Link with the gain that makes a computed amplitude the measured one."""
        if not 0.0 < measured_volt < math.inf:
            raise ValidityError(f"measured return {measured_volt} V is not above 0 and finite")
        return replace(self, volts_per_ampere=self.volts_per_ampere * measured_volt / computed_volt)


@dataclass(frozen=True)
class LinkReflector:
    """Retroreflector as the beam meets it.

    aperture     m, radius of the clear face; the GBT's prisms have 25.4 mm
    height       m, of the corner behind the face
    index        phase index of its material: 1 for a hollow cube
    reflectance  of all its surfaces
    dihedral     rad, by which the angles between its faces exceed right angles
    """

    aperture: float = 25.4e-3
    height: float = 38.1e-3
    index: float = 1.511
    reflectance: float = 0.92
    dihedral: tuple[float, float, float] = (0.0, 0.0, 0.0)
