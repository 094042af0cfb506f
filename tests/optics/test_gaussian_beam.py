"""The beam against what diffraction theory knows in closed form, and against a sum over rays."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.optics.abcd import beam_at_waist, free_space, onward, thin_lens, through
from catseye.optics.abcd import radius as radius_of
from catseye.optics.gaussian_beam import (
    powers_through,
    radius,
    returned_share,
    share_within,
    share_within_ellipse,
    waist_for,
)

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


def test_the_returned_share_never_exceeds_the_incident_share():
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


def test_an_elliptical_beam_passes_an_aperture_as_drawn_photons_do():
    photons = np.random.default_rng(2).normal(scale=0.5, size=(400_000, 2)) * [2.0, 0.7]
    for aperture in (0.5, 1.5):
        drawn = np.mean(np.hypot(*photons.T) < aperture)
        assert share_within_ellipse(aperture, 2.0, 0.7) == pytest.approx(drawn, abs=0.003)
    assert share_within_ellipse(0.7, 1.0, 1.0) == pytest.approx(float(share_within(0.7, 1.0)), rel=1e-12)


def test_no_other_waist_makes_a_smaller_spot():
    best = float(waist_for(120.0, LIGHT, 1.3))
    spot = radius(120.0, waist=best, wavelength=LIGHT, quality=1.3)
    assert spot == pytest.approx(best * np.sqrt(2.0), rel=1e-12)
    others = radius(120.0, waist=best * np.array([0.9, 0.99, 1.01, 1.1]), wavelength=LIGHT, quality=1.3)
    assert np.all(others > spot)


def straight(distance):
    return [free_space(distance)] * 2


def test_a_train_of_two_discs_is_the_round_formula():
    for distance, aperture, receiver in ((40.0, 0.010, 0.02), (120.0, 0.0127, 0.03), (300.0, 0.0254, 0.05)):
        q = onward(beam_at_waist(0.01, LIGHT), free_space(distance))
        found = powers_through(
            [q, q], wavelengths=[LIGHT] * 2, discs=[aperture, receiver], systems=[straight(distance)]
        )
        known = returned_share(distance, aperture=aperture, receiver=receiver, waist=0.01, wavelength=LIGHT)
        assert found[1] == pytest.approx(known, abs=2e-6)  # its own quadrature is good to 1e-6


def test_an_elliptical_beam_through_a_round_reflector_is_what_a_fourier_transform_makes_of_it():
    """Fresnel's integral on a grid, an independent way: the lens is the plane of a discrete Fourier transform."""
    distance, aperture, receiver, points = 150.0, 0.006, 0.012, 1024
    q = np.array([onward(beam_at_waist(w, LIGHT), free_space(distance)) for w in (0.004, 0.009)])
    found = powers_through(q, wavelengths=[LIGHT] * 2, discs=[aperture, receiver], systems=[straight(distance)])
    x = (np.arange(points) - points / 2) * 0.06 / points
    (wx, wy), (cx, cy) = radius_of(q, LIGHT), np.real(1.0 / q)
    k, (grid_x, grid_y) = 2.0 * np.pi / LIGHT, np.meshgrid(x, x, indexing="ij")
    phase = 0.5 * k * (cx * grid_x**2 + cy * grid_y**2 + (grid_x**2 + grid_y**2) / distance)
    field = np.sqrt(2.0 / np.pi / wx / wy) * np.exp(-((grid_x / wx) ** 2) - (grid_y / wy) ** 2 - 1j * phase)
    step = x[1] - x[0]
    inside = np.clip((aperture - np.hypot(grid_x, grid_y)) / step + 0.5, 0.0, 1.0)  # the rim cuts cells
    far = np.fft.fftshift(np.fft.fft2(np.fft.ifftshift(field * inside))) * step**2 / (LIGHT * distance)
    there = np.fft.fftshift(np.fft.fftfreq(points, step)) * LIGHT * distance
    power = np.abs(far) ** 2 * (there[1] - there[0]) ** 2
    at = np.hypot(*np.meshgrid(there, there, indexing="ij"))
    seen = np.sum(power * np.clip((receiver - at) / (there[1] - there[0]) + 0.5, 0.0, 1.0))
    assert found[1] == pytest.approx(seen, abs=0.002)  # the grid's steps at both rims
    assert 0.3 < found[1] < 0.95 * found[0]


def test_in_the_focus_a_clipped_plane_wave_is_an_airy_disc():
    from scipy.special import j0, j1

    edge, focal, pinhole = 0.005, 0.2, 30e-6
    wide = beam_at_waist(0.5, LIGHT)  # as good as a plane wave
    focus = through(thin_lens(focal), free_space(focal))
    found = powers_through([wide, wide], wavelengths=[LIGHT] * 2, discs=[edge, pinhole], systems=[[focus, focus]])
    x = 2.0 * np.pi / LIGHT * edge * pinhole / focal
    assert found[1] / found[0] == pytest.approx(1.0 - j0(x) ** 2 - j1(x) ** 2, rel=1e-3)


def test_a_beam_of_low_quality_clipped_by_an_edge_returns_more_than_the_bound_says():
    """M^2 as an ideal beam whose direction scatters (a Schell beam): each direction meets the reflector off centre."""
    from catseye.optics.spot import offset_share

    quality, waist, distance, aperture, receiver = 1.4, 0.008, 120.0, 0.009, 0.02
    q = onward(beam_at_waist(waist, LIGHT, quality), free_space(distance))
    lights = [quality * LIGHT] * 2
    bound = powers_through([q, q], wavelengths=lights, discs=[aperture, receiver], systems=[straight(distance)])[1]
    sigma = 0.5 * distance * LIGHT / (np.pi * waist) * np.sqrt(quality**2 - 1.0)
    offsets = sigma * np.sqrt(-2.0 * np.log(1.0 - (np.arange(12) + 0.5) / 12))  # equal shares of a round scatter
    size = {"aperture": aperture, "receiver": receiver, "waist": waist, "wavelength": LIGHT}
    true = float(np.mean(offset_share(offsets, distance, **size)))
    assert bound < true < bound + 0.1


def test_light_that_cannot_be_followed_is_refused():
    q = beam_at_waist(0.01, LIGHT)
    with pytest.raises(ValidityError, match="too much to integrate"):
        powers_through([q, q], wavelengths=[LIGHT] * 2, discs=[0.025, 0.05], systems=[straight(1.0)])
    with pytest.raises(ValidityError, match="images of each other"):
        powers_through([q, q], wavelengths=[LIGHT] * 2, discs=[0.01, 0.01], systems=[straight(0.0)])


def test_a_disc_that_stops_nothing_changes_nothing_not_even_for_cylinders():
    q = np.array([onward(beam_at_waist(w, LIGHT), free_space(20.0)) for w in (0.003, 0.005)])
    first = [free_space(30.0)] * 2
    second = [through(thin_lens(25.0), free_space(30.0)), through(thin_lens(-40.0), free_space(30.0))]
    direct = [through(a, b) for a, b in zip(first, second, strict=True)]
    lights = [LIGHT] * 2
    three = powers_through(q, wavelengths=lights, discs=[0.007, 0.025, 0.004], systems=[first, second])
    two = powers_through(q, wavelengths=lights, discs=[0.007, 0.004], systems=[direct])
    assert three[1] == pytest.approx(three[0], abs=2e-3)  # the edge's rings reach past any disc
    assert three[2] == pytest.approx(two[1], abs=2e-3)
    assert two[1] < 0.8 * two[0]


@pytest.mark.parametrize(
    ("aperture", "ratio"), [(1.0, 30.0), (30.0, 30.0), (100.0, 100.0), (3000.0, 1000.0), (0.5, 3.0)]
)
def test_the_share_of_a_very_flat_beam_is_an_integral_over_strips(aperture, ratio):
    from scipy.special import ndtr

    edge = np.linspace(-min(aperture, 4.0), min(aperture, 4.0), 200_001)
    middle = 0.5 * (edge[1:] + edge[:-1])
    strip = np.diff(ndtr(2.0 * edge))  # of the narrow axis, radius 1
    expected = np.sum(strip * (2.0 * ndtr(2.0 * np.sqrt(aperture**2 - middle**2) / ratio) - 1.0))
    assert share_within_ellipse(aperture, 1.0, ratio) == pytest.approx(expected, rel=1e-7)
    assert share_within_ellipse(aperture, ratio, 1.0) == pytest.approx(expected, rel=1e-7)
    assert share_within_ellipse([0.0, np.inf], 1.0, ratio).tolist() == pytest.approx([0.0, 1.0], abs=1e-12)
