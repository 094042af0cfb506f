"""What returns from a retroreflector off the beam's middle, against closed forms and a Fourier propagation.

The closed forms hold where one of the apertures takes everything: then the other sees a Gaussian beam off its centre.
The Fourier propagation (square grids, numpy's FFT) shares no line with the code.
"""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.optics.gaussian_beam import radius, returned_share, share_within
from catseye.optics.spot import (
    gaussian_spot,
    offset_range,
    offset_share,
    reach,
    steering_range,
)
from optics.spot_scene import matched_radius

HEAD = {"waist": 0.010, "wavelength": 0.78e-6}
GBT = {"aperture": 0.0254, "receiver": 0.050, **HEAD}


def propagated(offset, distance, *, aperture, receiver, waist, wavelength, n=1024, width=0.30):
    """Share by an FFT: the beam in its waist at -offset.., the corner's turn, and the way back, on one square grid."""
    x = (np.arange(n) - n // 2) * width / n
    xx, yy = np.meshgrid(x, x, indexing="ij")
    f = np.fft.fftfreq(n, width / n)
    fx, fy = np.meshgrid(f, f, indexing="ij")
    transfer = np.exp(-1j * np.pi * wavelength * distance * (fx**2 + fy**2))
    field = np.sqrt(2 / np.pi) / waist * np.exp(-((xx - offset) ** 2 + yy**2) / waist**2)  # the corner is the origin
    field = np.fft.ifft2(np.fft.fft2(field) * transfer) * (np.hypot(xx, yy) <= aperture)
    field = np.roll(field[::-1, ::-1], (1, 1), (0, 1))  # turned about the corner
    field = np.fft.ifft2(np.fft.fft2(field) * transfer)
    lens = np.hypot(xx - offset, yy) <= receiver
    return float(np.sum(np.abs(field[lens]) ** 2) * (width / n) ** 2)


@pytest.mark.parametrize(
    ("aperture", "receiver", "waist", "distance"),
    [(0.0254, 0.05, 0.01, 120.0), (0.01, 0.05, 0.01, 120.0), (0.005, 0.02, 0.01, 60.0), (0.0254, 0.03, 0.02, 200.0)],
)
def test_a_centred_beam_returns_what_the_polar_integral_says(aperture, receiver, waist, distance):
    size = {"aperture": aperture, "receiver": receiver, "waist": waist, "wavelength": 0.78e-6}
    assert offset_share(0.0, distance, **size) == pytest.approx(returned_share(distance, **size), abs=2e-5)


@pytest.mark.parametrize("offset", [0.0, 0.01, 0.02])
def test_before_a_wide_retroreflector_the_beam_comes_back_twice_as_far_off(offset):
    found = offset_share(offset, 120.0, aperture=0.06, receiver=0.03, **HEAD)
    twice_as_far = share_within(0.03, float(radius(240.0, **HEAD)), 2 * offset)
    assert found == pytest.approx(float(twice_as_far), abs=1e-7)


@pytest.mark.parametrize("offset", [0.0, 0.0084, 0.016, 0.025])
def test_a_fourier_propagation_gives_the_same_share(offset):
    for size in (GBT, {**GBT, "aperture": 0.012}):
        assert offset_share(offset, 120.0, **size) == pytest.approx(propagated(offset, 120.0, **size), abs=2e-3)
        # the grid's pixels, 0.3 mm, make the edge of the aperture rough


def test_the_share_falls_on_both_sides_alike_and_to_nothing():
    d = np.array([-0.02, -0.01, 0.0, 0.01, 0.02, 0.1])
    found = offset_share(d, 120.0, **GBT)
    np.testing.assert_array_equal(found[:2], found[[4, 3]])
    assert np.all(np.diff(found[2:]) < 0.0)
    assert found[-1] < 1e-12


def test_diffraction_moves_the_range_by_less_than_a_micrometre_within_half_a_count():
    """Half a count either way is 8.4 mm at 120 m; the electronic wave is 0.2 m long."""
    change = offset_range([0.0, 0.0042, 0.0084], 120.0, **GBT)
    assert change[0] == 0.0
    assert np.max(np.abs(change)) < 5e-9
    assert np.all(np.abs(offset_range([0.0042, 0.0084], 120.0, **{**GBT, "aperture": 0.012})) < 1e-6)


def test_the_optical_path_off_centre_is_that_of_the_wavefronts_curvature():
    """All is taken in by wide apertures: the beam's own path there and back does not depend on where the corner is."""
    wide = {"aperture": 0.04, "receiver": 0.04, **HEAD}
    assert abs(offset_range(0.003, 120.0, **wide)) < 1e-9


def test_steering_shortens_a_range_by_the_cosine():
    assert steering_range(0.0084, 120.0) == pytest.approx(120.0 * (np.cos(0.0084 / 120.0) - 1.0), abs=1e-13)
    assert steering_range([0.0, -1.0], 120.0).round(6).tolist() == [0.0, -0.004167]


def test_the_gaussian_that_matches_falls_to_half_where_the_spot_does():
    s = matched_radius(120.0, **GBT)
    half = float(reach(s, 0.5))
    top = float(offset_share(0.0, 120.0, **GBT))
    assert float(offset_share(half, 120.0, **GBT)) == pytest.approx(0.5 * top, rel=1e-3)
    assert half == pytest.approx(0.0239, abs=2e-4)  # near the edge of the 25.4 mm retroreflector, as it must be
    assert float(gaussian_spot(half, 0.0, peak=top, radius=s, background=0.0)) == pytest.approx(0.5 * top, rel=1e-9)
    assert float(gaussian_spot(0.0, s, peak=1.0, radius=s, background=0.5)) == pytest.approx(0.5 + np.exp(-2.0))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: offset_share(0.0, -1.0, **GBT), "distance = -1.0 is not above 0"),
        (lambda: offset_share(np.nan, 1.0, **GBT), "offset nan m is not finite"),
        (lambda: offset_share(0.0, 1.0, **GBT), "too much to integrate"),
        (lambda: offset_range(0.0, 100.0, **GBT, modulation_hz=0.0), "modulation_hz = 0.0"),
        (lambda: reach(1.0, 0.0), "share 0.0 of a peak"),
    ],
)
def test_invalid_beams_are_refused(call, message):
    with pytest.raises(ValidityError, match=message):
        call()
