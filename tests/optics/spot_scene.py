"""Gaussian spot that stands for the real one of a scan."""

from scipy.optimize import brentq

from catseye.optics.gaussian_beam import radius
from catseye.optics.spot import offset_share, reach


def matched_radius(distance: float, **light: float) -> float:
    """Radius, m at the target, of the Gaussian spot that falls to half where the real one does.

    light   aperture, receiver, waist, wavelength, as for `offset_share`
    """
    peak = float(offset_share(0.0, distance, **light))
    far = float(radius(distance, waist=light["waist"], wavelength=light["wavelength"])) + light["aperture"]
    half = brentq(lambda off: float(offset_share(off, distance, **light)) - 0.5 * peak, 0.0, 1.5 * far, xtol=1e-6 * far)
    return float(half / reach(1.0, 0.5))
