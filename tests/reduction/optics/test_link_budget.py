"""The link budget: a corner's clear area by rays, scaling laws, and the noise of a real night."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.optics.retroreflector.prism import clear_share
from catseye.reduction.optics.link import Link, LinkReflector
from catseye.reduction.optics.link_budget import link_budget

LINK, PRISM = Link(), LinkReflector()


def reflected_share(incidence, azimuth, *, aperture, height, index, rays=60_000):
    """Rays that enter a round face, meet three planes at right angles in any order, and leave through the face."""
    rng = np.random.default_rng(5)
    r, turn = aperture * np.sqrt(rng.uniform(size=rays)), rng.uniform(0.0, 2 * np.pi, rays)
    at = np.stack([r * np.cos(turn), r * np.sin(turn), np.zeros(rays)], axis=1)
    sine = np.sin(incidence) / index
    ray = np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), -np.sqrt(1.0 - sine**2)])
    ray = np.tile(ray, (rays, 1))
    # the three planes through the corner at (0, 0, -height), their normals leaning equally towards the face
    across = np.array([[1.0, 0.0], [-0.5, np.sqrt(0.75)], [-0.5, -np.sqrt(0.75)]])
    normals = np.concatenate([np.sqrt(2.0 / 3.0) * across, np.full((3, 1), np.sqrt(1.0 / 3.0))], axis=1)
    corner = np.array([0.0, 0.0, -height])
    for _ in range(3):
        along = ray @ normals.T
        distance = np.where(along < -1e-12, ((corner - at) @ normals.T) / np.where(along == 0, 1, along), np.inf)
        distance = np.where(distance > 1e-12, distance, np.inf)
        first = distance.argmin(axis=1)
        at = at + distance.min(axis=1)[:, None] * ray
        ray = ray - 2.0 * np.take_along_axis(along, first[:, None], axis=1) * normals[first]
    at = at - (at[:, 2] / ray[:, 2])[:, None] * ray
    return np.mean(np.hypot(at[:, 0], at[:, 1]) < aperture) * np.cos(incidence)


@pytest.mark.parametrize("incidence", [0.0, 0.15, 0.3, 0.5])
@pytest.mark.parametrize("azimuth", [0.2, 1.9])
def test_the_clear_area_of_a_corner_is_that_of_traced_rays(incidence, azimuth):
    shape = {"aperture": 0.0254, "height": 0.0381, "index": 1.511}
    traced = reflected_share(incidence, azimuth, **shape)
    assert clear_share(incidence, **shape) == pytest.approx(traced, abs=0.01)


def test_twice_the_power_is_twice_the_volts_and_a_halved_gain_half():
    one = link_budget(LINK, PRISM, 100.0)
    assert link_budget(replace(LINK, power=20e-3), PRISM, 100.0).amplitude_volt == pytest.approx(2 * one.amplitude_volt)
    measured = LINK.scaled(one.amplitude_volt, 5.0)
    assert link_budget(measured, PRISM, 100.0).amplitude_volt == pytest.approx(5.0)


def test_four_times_the_duration_halves_the_noise():
    one, four = (link_budget(replace(LINK, duration=d), PRISM, 100.0) for d in (0.128, 0.512))
    assert four.u_range == pytest.approx(0.5 * one.u_range)


def test_oblique_and_missed_reflectors_return_less_and_know_less():
    straight = link_budget(LINK, PRISM, 100.0)
    for weak in (link_budget(LINK, PRISM, 100.0, incidence=0.4), link_budget(LINK, PRISM, 100.0, offset=0.02)):
        assert weak.amplitude_volt < straight.amplitude_volt
        assert weak.u_range > straight.u_range
    dark = replace(LINK, blocked_noise_volt=0.0)
    same = link_budget(dark, PRISM, 100.0, background=straight.received).noise_shares
    assert same["shot noise of daylight"] == pytest.approx(same["shot noise of the return"])
    assert sum(straight.noise_shares.values()) == pytest.approx(1.0)


def test_the_samples_noise_of_night_01_gives_its_ranges_uncertainty(reduced_night_01):
    """The noise that the night's samples show, and its amplitudes, must end at the u of phase that detection claims."""
    phases = reduced_night_01.phases
    used = [k for k, status in enumerate(reduced_night_01.status) if status == "used"]
    amplitude, u = float(np.median(phases.amplitude[used])), float(np.median(phases.u_phase[used]))
    link = LINK.scaled(link_budget(LINK, PRISM, 100.0).amplitude_volt, amplitude)
    budget = link_budget(link, PRISM, 100.0)
    assert budget.u_phase == pytest.approx(u, rel=0.25)  # the heads' own noise is 0.165 to 0.245 V
    assert 5e-6 < budget.u_range < 20e-6


def test_full_scale_and_grazing_light_are_reported():
    assert link_budget(replace(LINK, volts_per_ampere=1e7), PRISM, 20.0).clipped
    with pytest.raises(ValidityError, match="no part of the face"):
        link_budget(LINK, PRISM, 100.0, incidence=1.4)
    with pytest.raises(ValidityError, match="right angle"):
        link_budget(LINK, PRISM, 100.0, incidence=1.6)
    for link, reflector in (
        (replace(LINK, power=0.0), PRISM),
        (replace(LINK, transmission=1.5), PRISM),
        (LINK, replace(PRISM, index=0.5)),
    ):
        with pytest.raises(ValidityError, match=r"is (not|below)"):
            link_budget(link, reflector, 100.0)


def test_each_part_of_the_budget_is_its_hand_computation():
    link = replace(LINK, extinction_per_m=1e-3, blocked_noise_volt=0.01, amplifier=40e-12, bits=12, crosstalk=2e-3)
    found = link_budget(link, PRISM, 500.0, background=3e-6)
    assert found.factors["air, there and back"] == pytest.approx(0.367879, abs=1e-6)  # 1/e over a kilometre
    shot = 2 * 1.602176634e-19 * 0.45 * found.received  # A^2/Hz
    shares = found.noise_shares
    of_return = shares["shot noise of the return"]
    assert shares["amplifier"] / of_return == pytest.approx(1.6e-21 / shot, rel=1e-9)
    assert shares["shot noise of daylight"] / of_return == pytest.approx(3e-6 / found.received, rel=1e-9)
    step = 20.0 / 4096  # of a converter of 12 bits over -10 to 10 V
    rounding = shares["converter's rounding"] / shares["samples with the beam blocked"]
    assert rounding == pytest.approx(step**2 / 12 / 1e-4, rel=1e-9)
    turned = 2e-3 / found.amplitude_volt  # rad; half a wavelength, 99.93 mm, is a turn
    assert found.crosstalk_range == pytest.approx(0.09993082 * turned / (2 * np.pi), rel=1e-4)


def test_a_wide_beam_on_a_tilted_prism_follows_its_clear_area():
    wide = replace(LINK, waist=0.5)
    straight, tilted = (link_budget(wide, PRISM, 100.0, incidence=i).factors for i in (0.0, 0.3))
    share = clear_share(0.3, aperture=0.0254, height=0.0381, index=1.511)
    assert tilted["hits the reflector"] / straight["hits the reflector"] == pytest.approx(share, rel=0.01)


@pytest.mark.parametrize("off", [{"offset": -0.01}, {"offset": np.nan}, {"background": -1e-6}, {"background": np.inf}])
def test_negative_offset_and_negative_daylight_are_refused(off):
    with pytest.raises(ValidityError, match="is not 0 or more and finite"):
        link_budget(LINK, PRISM, 100.0, **off)


def test_noise_that_is_no_number_and_light_that_never_returns_are_refused():
    for noise in (np.nan, np.inf, -0.1):
        with pytest.raises(ValidityError, match="blocked_noise_volt"):
            link_budget(replace(LINK, blocked_noise_volt=noise), PRISM, 100.0)
    with pytest.raises(ValidityError, match="no light comes back"):
        link_budget(LINK, PRISM, 100.0, offset=5.0)
    for size in ({"waist": np.inf}, {"receiver": np.inf}):
        with pytest.raises(ValidityError, match="above 0 and finite"):
            link_budget(replace(LINK, **size), PRISM, 100.0)
    with pytest.raises(ValidityError, match="above 0 and finite"):
        link_budget(LINK, PRISM, np.inf)
