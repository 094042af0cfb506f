"""Traced light of a retroreflector: the formulas of `optics`, which the simulator does not use, agree."""

import numpy as np
import pytest

from catseye.geometry.mirror.search_pattern import offsets_of_counts
from catseye.optics.retroreflector.hollow_cube import HollowCube
from catseye.optics.retroreflector.solid_prism import SolidPrism
from catseye.optics.spot import offset_share
from catseye.simulator.laboratory.spots import SpotLight, TrueCorner, beam_direction, scan_amplitudes


def test_the_spot_is_that_of_diffraction():
    """At 120 m, to some hundredths: waves spread by 4 mm round the opening's edge, and rays do not."""
    light = SpotLight()
    off = np.array([0.0, 0.005, 0.010, 0.015, 0.020])
    waves = offset_share(off, 120.0, aperture=0.0254, receiver=0.05, waist=0.010, wavelength=0.78e-6)
    np.testing.assert_allclose(light.share(off), waves / waves[0], atol=0.05)
    assert light.share(np.array([0.2]))[0] == 0.0


def test_beams_are_those_of_the_encoder():
    zeros, centre = np.array([2691.0, 1434.0]), np.array([20_000.0, 9_000.0])
    counts = centre + np.array([[3.0, 0.0], [0.0, 4.0], [-5.0, 2.0]])
    chord = np.linalg.norm(beam_direction(counts, zeros) - beam_direction(centre, zeros), axis=1)
    np.testing.assert_allclose(chord, np.hypot(*offsets_of_counts(centre, zeros, counts).T), rtol=1e-6)


def test_amplitudes_are_reproducible_clip_and_never_fall_below_zero():
    counts, zeros = np.array([[0.0, 9e3], [30.0, 9e3]]), np.array([0.0, 0.0])
    light = SpotLight(peak_volt=20.0)
    first, again = (
        scan_amplitudes(counts, counts[0], zeros, distance=120.0, light=light, rng=np.random.default_rng(1))
        for _ in range(2)
    )
    np.testing.assert_array_equal(first, again)
    assert first[0] == 10.0
    assert 0.0 <= first[1] < 0.2


@pytest.mark.parametrize("incidence_deg", [0.0, 10.0, 25.0, 40.0])
@pytest.mark.parametrize("azimuth_deg", [0.0, 60.0, 100.0])
def test_traced_corners_return_what_the_kinds_say(incidence_deg, azimuth_deg):
    """Within the size of the grid of rays: 0.3 % of the face."""
    i, a = np.radians(incidence_deg), np.radians(azimuth_deg)
    solid = SolidPrism(0.0381, 0.0254, group=1.527, phase=1.5112)
    assert TrueCorner().share(i, a) == pytest.approx(float(solid.return_share(i, a)), abs=0.004)
    height = np.sqrt(2.0) * 0.0254
    mirrors = TrueCorner(height=height, index=1.0, mirror=0.97)
    assert mirrors.share(i, a) == pytest.approx(float(HollowCube(0.0254, height, 0.97).return_share(i, a)), abs=0.004)
