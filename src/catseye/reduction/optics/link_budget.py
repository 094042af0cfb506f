"""Expected return: laser power to volts and the range's noise."""

from dataclasses import dataclass

import numpy as np

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.optics.gaussian_beam import radius, returned_share, share_within
from catseye.optics.receiver import noise_density, signal_current, u_phase
from catseye.optics.retroreflector.dihedral import collected_share, deviations, pupil_offset
from catseye.optics.retroreflector.prism import clear_share
from catseye.reduction.optics.link import Link, LinkReflector
from catseye.signal.systematics.leakage import worst_range_error
from catseye.verdict import Verdict

NOISY = 1e-3  # m, noise of a range beyond which a link is doubtful


@dataclass(frozen=True)
class LinkBudget:
    """Factors between the laser and the range.

    factors          name: share of the power behind it, in order
    received         W on the detector
    amplitude_volt   at the converter
    u_volt           V, standard uncertainty of each quadrature of the phasor
    u_phase          rad, from noise alone
    u_range          m, from noise alone
    crosstalk_range  m, largest error of the residual crosstalk: a bias, not noise; a quarter of half a
                     wavelength where it is as large as the return
    noise_shares     name: share of the noise's density
    clipped          True if the amplitude exceeds the converter's range
    deviation        rad, largest of the six returned beams from the way back
    pupil_offset     m, range error of a bare detector in these beams, positive where too long; a lens removes it
    """

    factors: dict[str, float]
    received: float
    amplitude_volt: float
    u_volt: float
    u_phase: float
    u_range: float
    crosstalk_range: float
    noise_shares: dict[str, float]
    clipped: bool
    deviation: float
    pupil_offset: float

    @property
    def verdict(self) -> Verdict:
        """Good where the return fits the converter and the noise of a range stays below a millimetre."""
        if self.clipped:
            return Verdict("doubtful", "the return is more than the converter takes: it clips")
        if self.u_range > NOISY:
            return Verdict("doubtful", f"the range's noise is {1e3 * self.u_range:.2g} mm")
        return Verdict("good", f"a return of {self.amplitude_volt:.3g} V, noise of a range below 1 mm")


def link_budget(
    link: Link,
    reflector: LinkReflector,
    distance: float,
    *,
    incidence: float = 0.0,
    offset: float = 0.0,
    background: float = 0.0,
) -> LinkBudget:
    """Expected amplitude and noise of the range to one retroreflector.

    link         head and optics
    reflector    the retroreflector
    distance     m, above 0
    incidence    rad, 0 to below a right angle, on the reflector's face
    offset       m, of the beam's axis from the reflector's centre
    background   W of daylight on the detector

    The return is computed by diffraction for a centred circular aperture as large as the effective clear one at that
    incidence; a beam off centre is scaled by its loss on the outward path.

    Raises ValidityError for invalid values, for a near, wide aperture (see `returned_share`), and where no
    light comes back.

    Source: [SIEGMAN86] and [GOODMAN05] for the beam, [YARIV97] for the noise, [RIFE74] for the phase: see each.
    """
    _refuse_nonsense(link, reflector, offset, background)
    if not 0.0 <= incidence < 0.5 * np.pi:
        raise ValidityError(f"incidence {incidence} rad is not within 0 and a right angle (expected below 1.5708)")
    clear = float(clear_share(incidence, aperture=reflector.aperture, height=reflector.height, index=reflector.index))
    if clear <= 0.0:
        raise ValidityError(f"at an incidence of {np.degrees(incidence):.1f} deg no part of the face returns light")
    effective = reflector.aperture * np.sqrt(clear)
    beam = float(radius(distance, waist=link.waist, wavelength=link.wavelength))
    hit = float(share_within(effective, beam, offset))
    centred = float(share_within(effective, beam))
    size = {"aperture": effective, "receiver": link.receiver, "waist": link.waist, "wavelength": link.wavelength}
    factors = {
        "head's optics": link.transmission,
        "air, there and back": float(np.exp(-2.0 * link.extinction_per_m * distance)),
        "hits the reflector": hit,
        "reflector's surfaces": reflector.reflectance,
        "comes into the lens": returned_share(distance, **size) / centred,
    }
    turned = np.hypot(*deviations(reflector.dihedral, reflector.index).T)
    if turned.any():
        back = radius(2.0 * distance, waist=link.waist, wavelength=link.wavelength)
        factors["dihedral errors"] = float(
            np.mean(collected_share(turned, distance, beam_radius=back, receiver=link.receiver))
        )
    received = link.power * float(np.prod(list(factors.values())))
    amplitude = float(signal_current(received, depth=link.depth, responsivity=link.responsivity))
    amplitude *= link.volts_per_ampere
    if not amplitude > 0.0:
        raise ValidityError(f"no light comes back from {distance} m with the beam {offset} m off the reflector")
    parts = _noises(link, received, background)
    density = sum(parts.values())
    u = float(u_phase(amplitude, density, link.duration))
    half = 0.5 * SPEED_OF_LIGHT / link.modulation_hz
    return LinkBudget(
        factors=factors,
        received=received,
        amplitude_volt=amplitude,
        u_volt=u * amplitude,
        u_phase=u,
        u_range=u * half / TWO_PI,
        crosstalk_range=float(worst_range_error(min(link.crosstalk / amplitude, 1.0), 2.0 * half)),
        noise_shares={name: part / density for name, part in parts.items()},
        clipped=amplitude > link.full_scale_volt,
        deviation=float(turned.max()),
        pupil_offset=pupil_offset(
            float(np.mean(turned) * np.sign(np.sum(reflector.dihedral))), aperture=effective, beam_radius=beam
        ),
    )


def _refuse_nonsense(link: Link, reflector: LinkReflector, offset: float, background: float) -> None:
    """Raise ValidityError for impossible factors.

    Factors of light lie above 0 and up to 1, divisors above 0, noise and losses 0 or more.
    """
    shares = {"depth": link.depth, "transmission": link.transmission, "reflectance": reflector.reflectance}
    for name, share in shares.items():
        if not 0.0 < share <= 1.0:
            raise ValidityError(f"{name} {share} is not above 0 and up to 1")
    sizes = {
        "power": link.power,
        "responsivity": link.responsivity,
        "volts_per_ampere": link.volts_per_ampere,
        "duration": link.duration,
        "samples_per_second": link.samples_per_second,
        "modulation_hz": link.modulation_hz,
        "aperture": reflector.aperture,
        "height": reflector.height,
    }
    for name, size in sizes.items():
        if not 0.0 < size < np.inf:
            raise ValidityError(f"{name} {size} is not above 0 and finite")
    parts = {
        "offset": offset,
        "background": background,
        "blocked_noise_volt": link.blocked_noise_volt,
        "full_scale_volt": link.full_scale_volt,
        "amplifier": link.amplifier,
        "crosstalk": link.crosstalk,
        "extinction_per_m": link.extinction_per_m,
    }
    for name, size in parts.items():
        if not 0.0 <= size < np.inf:
            raise ValidityError(f"{name} {size} is not 0 or more and finite")
    if not link.intensity_noise_db_hz < np.inf:
        raise ValidityError(f"intensity_noise_db_hz {link.intensity_noise_db_hz} is not a finite number or -inf")
    if not 1.0 <= reflector.index < np.inf:
        raise ValidityError(f"index {reflector.index} of the reflector is not 1, that of a hollow one, or more")


def _noises(link: Link, received: float, background: float) -> dict[str, float]:
    """One-sided noise densities at the converter, V^2/Hz."""
    gain = link.volts_per_ampere**2
    diode = {"responsivity": link.responsivity}
    light = gain * float(noise_density(received, **diode))
    laser = gain * float(noise_density(received, **diode, intensity_noise_db_hz=link.intensity_noise_db_hz)) - light
    step = link.full_scale_volt / 2 ** (link.bits - 1)
    return {
        "shot noise of the return": light,
        "shot noise of daylight": gain * float(noise_density(background, **diode)),
        "laser's intensity noise": laser,
        "amplifier": gain * link.amplifier**2,
        "samples with the beam blocked": link.blocked_noise_volt**2 * 2.0 / link.samples_per_second,
        "converter's rounding": step**2 / 12.0 * 2.0 / link.samples_per_second,
    }
