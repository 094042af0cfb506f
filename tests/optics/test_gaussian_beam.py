"""The beam against what diffraction theory knows in closed form, and against a sum over rays."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.optics.gaussian_beam import radius, returned_share, share_within

LIGHT = 0.78e-6


def test_far_away_a_beam_spreads_by_its_divergence():
    assert radius(1e6, waist=0.01, wavelength=LIGHT) == pytest.approx(1e6 * LIGHT / (np.pi * 0.01), rel=1e-5)
    assert radius(1e6, waist=0.01, wavelength=LIGHT, quality=2.0) == pytest.approx(2e6 * LIGHT / np.pi / 0.01, rel=1e-5)


def test_the_share_within_an_aperture_off_centre_is_that_of_drawn_photons():
    photons = np.random.default_rng(1).normal(scale=0.5, size=(400_000, 2))  # 1/e^2 radius of 1: sigma of 1/2
    for aperture, offset in ((0.7, 0.4), (0.3, 1.2)):
        drawn = np.mean(np.hypot(photons[:, 0] - offset, photons[:, 1]) < aperture)
        assert share_within(aperture, 1.0, offset) == pytest.approx(drawn, abs=0.003)
    assert share_within(0.7, 1.0, 1e-9) == pytest.approx(float(share_within(0.7, 1.0)), rel=1e-9)


def test_an_endless_retroreflector_is_a_mirror_at_twice_the_distance():
    size = {"receiver": 0.01, "waist": 0.01, "wavelength": LIGHT}
    there_and_back = share_within(0.01, radius(200.0, waist=0.01, wavelength=LIGHT))
    assert returned_share(100.0, aperture=0.1, **size) == pytest.approx(float(there_and_back), rel=1e-9)


def test_a_small_retroreflector_sends_back_an_airy_disc():
    from scipy.special import j0, j1

    aperture, receiver, waist, distance = 0.5e-3, 0.02, 0.2, 300.0
    found = returned_share(distance, aperture=aperture, receiver=receiver, waist=waist, wavelength=LIGHT)
    x = 2.0 * np.pi / LIGHT * aperture * receiver / distance
    airy = 1.0 - j0(x) ** 2 - j1(x) ** 2
    hit = float(share_within(aperture, float(radius(distance, waist=waist, wavelength=LIGHT))))
    assert found == pytest.approx(hit * airy, rel=1e-3)  # phase across the small aperture: a^2/(R wavelength) = 1e-3


def test_what_returns_is_never_more_than_what_hits():
    for distance in (60.0, 400.0):
        hit = float(share_within(0.019, radius(distance, waist=0.01, wavelength=LIGHT)))
        back = returned_share(distance, aperture=0.019, receiver=0.05, waist=0.01, wavelength=LIGHT)
        wide = returned_share(distance, aperture=0.019, receiver=0.15, waist=0.01, wavelength=LIGHT)
        assert back < wide <= hit * (1.0 + 1e-6)
        assert wide == pytest.approx(hit, rel=2e-3)


def test_zones_beyond_the_quadrature_and_lengths_that_are_none_are_refused():
    with pytest.raises(ValidityError, match="Fresnel zones"):
        returned_share(0.01, aperture=0.025, receiver=0.05, waist=0.01, wavelength=LIGHT)
    with pytest.raises(ValidityError, match=r"waist = 0.0 m is not above 0"):
        radius(1.0, waist=0.0, wavelength=LIGHT)
