"""Laser safety: others' numbers, the standards' seams, exact beams, sweeps against brute force."""

import tomllib
from itertools import pairwise

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.optics import gaussian_beam
from catseye.optics.safety import hazard as safety
from catseye.optics.safety import limits as safety_limits
from catseye.optics.safety.hazard import BINOCULARS, NAKED, LaserBeam, Viewer, classify, hazard_zone, returned_power
from catseye.optics.safety.limits import CLASSES, class_limit, eye_limits, eye_mpe, factors, skin_limit
from catseye.optics.safety.sweep import repetition_factor, sweep_hazard_distance, sweep_pulse, sweep_ratio
from repository import TESTS

VECTORS = tomllib.loads((TESTS / "vectors" / "safety.toml").read_text(encoding="utf-8"))["vector"]
PUPIL_AREA = np.pi / 4 * 7e-3**2


@pytest.mark.parametrize("vector", VECTORS, ids=[v["name"] for v in VECTORS])
def test_limits_are_those_that_others_print(vector):
    found = getattr(safety_limits, vector["function"])(**vector["inputs"])
    value = found if isinstance(found, float) else found.irradiance
    assert value == pytest.approx(vector["expected"], rel=vector["tolerance"])


def test_the_ranger_s_own_numbers():
    # C_A(780 nm) = 10^(0.002*80); class 1 is 0.39 mW of it rounded by IEC, 0.385 mW by the pupil's area in ANSI
    assert factors(0.780).c_a == pytest.approx(1.4454, abs=5e-5)
    assert class_limit("1", 0.780, 100.0) == pytest.approx(0.5637e-3, abs=5e-8)
    assert class_limit("1", 0.780, 100.0, edition="ansi2014") == pytest.approx(14.4544 * PUPIL_AREA, rel=1e-5)
    assert class_limit("3R", 0.780, 100.0) == pytest.approx(2.891e-3, abs=5e-7)
    assert skin_limit(0.5, 10.0).irradiance == pytest.approx(1.1e4 * 10**-0.75)  # the lower one at a border
    assert class_limit("3R", 0.780, 100.0, edition="ansi2014") == pytest.approx(5 * 14.4544 * PUPIL_AREA, rel=1e-5)


def test_an_exposure_at_every_border_of_the_tables_is_the_lower_one():
    # the printed powers join to within 5 %; both sides of a border of times, the border itself the lower
    for wavelength in (0.45, 0.55, 0.65, 0.78, 0.9, 1.064, 1.3):
        for border in (5e-6, 13e-6, 625e-6, 0.25, 10.0, 100.0):
            before, at, after = (eye_mpe(wavelength, border * f).irradiance for f in (1 - 1e-9, 1.0, 1 + 1e-9))
            assert at <= before * (1 + 1e-8)
            assert at == pytest.approx(after, rel=1e-6)
            assert at == pytest.approx(before, rel=0.06)


def test_blue_light_is_limited_by_chemistry_and_infrared_is_not():
    assert eye_mpe(0.405, 100.0).name == "chemistry on the retina"
    assert eye_mpe(0.405, 100.0).irradiance == pytest.approx(1.0)  # [IEC14] table A.1: 100 J/m2 in 100 s
    assert eye_mpe(0.405, 3e4).irradiance == pytest.approx(1.0)
    assert eye_mpe(0.488, 3e4).irradiance == pytest.approx(10 ** (0.02 * 38))
    # T_1 says when chemistry takes over at 475 nm: 10 * 10^0.5 s
    t_1 = factors(0.475).t_1
    assert t_1 == pytest.approx(31.623, abs=1e-3)
    assert eye_mpe(0.475, 0.98 * t_1).name == "heat on the retina"
    assert eye_mpe(0.475, 1.02 * t_1).name == "chemistry on the retina"
    assert [limit.name for limit in eye_limits(0.780, 3e4)] == ["heat on the retina"]


def test_a_large_blue_source_is_averaged_over_gamma():
    point = next(m for m in eye_limits(0.45, 100.0, 11e-3) if "chem" in m.name).irradiance
    large = next(m for m in eye_limits(0.45, 100.0, 44e-3) if "chem" in m.name).irradiance
    assert large / point == pytest.approx(16.0)


def test_a_source_larger_than_alpha_max_grows_by_its_area():
    # ANSI's form of the whole source's light; IEC's alpha_max/alpha_min for the part within alpha_max is the same
    assert factors(0.78, 1e-4, 9e-3).c_e == pytest.approx(9**2 / (5 * 1.5))
    assert factors(0.78, 0.01, 40e-3).c_e == pytest.approx(20 / 1.5 * (40 / 20) ** 2)
    assert factors(0.78, 1.0, 80e-3).c_e == pytest.approx(80 / 1.5)


def test_beyond_1300_nm_the_front_of_the_eye_counts():
    assert eye_mpe(1.39, 100.0).irradiance == pytest.approx(skin_limit(1.39, 100.0).irradiance)
    assert eye_mpe(1.39, 100.0, edition="ansi2014").name == "heat on the cornea"
    assert class_limit("1", 1.39, 100.0) == 0.5  # the retina alone would allow kilowatts: class 3B caps it


def test_classes_of_well_known_lasers():
    pointer = {"wavelength_um": 0.65, "diameter": 1e-3, "divergence": 1.2e-3}
    for power, expected in ((0.3e-3, "1"), (0.9e-3, "2"), (4.5e-3, "3R"), (6e-3, "3B"), (0.6, "4")):
        assert classify(LaserBeam(power, **pointer)).laser_class == expected
    infrared = {"wavelength_um": 0.78, "diameter": 1e-3, "divergence": 1.2e-3}
    for power, expected in ((0.5e-3, "1"), (0.9e-3, "3R"), (4.5e-3, "3B"), (0.6, "4")):
        assert classify(LaserBeam(power, **infrared)).laser_class == expected


def test_a_wide_beam_is_1m_or_2m():
    # 20 mm at 1/e2: 21.7 % through 7 mm, all through 50 mm
    assert classify(LaserBeam(2e-3, 0.78, 0.02, 0.06e-3)).laser_class == "1M"
    assert classify(LaserBeam(4e-3, 0.65, 0.02, 0.06e-3)).laser_class == "2M"
    assert classify(LaserBeam(2.8e-3, 0.78, 0.02, 0.06e-3)).laser_class == "3R"
    assert classify(LaserBeam(10e-3, 0.78, 0.02, 0.06e-3)).laser_class == "3B"


def test_editions_may_disagree_about_a_class_and_reasons_say_numbers():
    beam = LaserBeam(0.560e-3, 0.78, 1e-3, 1.2e-3)
    assert classify(beam).laser_class == "1"
    verdict = classify(beam, edition="ansi2014")
    assert verdict.laser_class == "3R"
    assert verdict.laser_class in CLASSES
    assert verdict.reasons[0].startswith("class 1: 0.56 mW")
    assert verdict.reasons[-1].endswith("keeps the limit of 2.781 mW")


def test_intended_long_viewing_lowers_class_1_where_chemistry_rules():
    beam = LaserBeam(0.1e-3, 0.405, 1e-3, 1e-3)
    assert classify(beam, long_viewing=True).limits["1"] == pytest.approx(3.9e-5)
    assert classify(LaserBeam(0.1e-3, 0.44, 1e-3, 1e-3)).limits["1"] == pytest.approx(3.9e-5)


def test_hazard_distance_of_a_watt_that_a_handbook_prints():
    # a show laser handbook: 1000 mW, 1 mrad, 225 m; its diameters are at 1/e, its exposure the peak
    beam = LaserBeam(1.0, 0.532, 1e-3, np.sqrt(2.0) * 1e-3)
    assert hazard_zone(beam, eye_limits(0.532, 0.25))[1] == pytest.approx(225.0, rel=0.01)


def test_the_hazard_ends_where_the_average_over_the_pupil_is_the_limit():
    narrowing = LaserBeam(0.05, 0.9, 0.03, 4e-4, 40.0)
    for beam in (LaserBeam(0.01, 0.78, 0.02, 5e-5), LaserBeam(0.3, 0.532, 1e-3, 2e-3), narrowing):
        limits = eye_limits(beam.wavelength_um, 0.25)
        near, far = hazard_zone(beam, limits)
        given = gaussian_beam.share_within(3.5e-3, 0.5 * beam.diameter_at(far)) * beam.power / PUPIL_AREA
        assert float(given) == pytest.approx(limits[0].irradiance, rel=1e-9)
        if near > 0.0:
            assert beam.power_within(7e-3, near) == pytest.approx(limits[0].power, rel=1e-9)


def test_a_beam_that_narrows_is_a_hazard_only_about_its_waist():
    # 40 mm wide where it leaves, 40 m on 5.6 mm: 14 mW spread at first, gathered there
    beam = LaserBeam(5e-3, 0.78, 0.040, 0.99e-3, 40.0)
    near, far = hazard_zone(beam, eye_limits(0.78, 100.0))
    assert 5.0 < near < 40.0 < far < 75.0
    assert near + far == pytest.approx(80.0, rel=1e-9)
    assert beam.power_within(7e-3, 0.5 * near) < class_limit("1", 0.78, 100.0) < beam.power_within(7e-3, 40.0)


def test_ansi_s_approximation_is_longer_and_agrees_far_away():
    limits = eye_limits(0.78, 100.0)
    for power, allowed in ((0.01, 0.02), (1.0, 3e-4)):
        beam = LaserBeam(power, 0.78, 0.003, 1e-3)
        a, phi = beam.diameter / np.sqrt(2), beam.divergence / np.sqrt(2)
        printed = np.sqrt(4 * power / (np.pi * limits[0].irradiance) - a**2) / phi
        exact = hazard_zone(beam, limits)[1]
        assert exact <= printed <= exact * (1 + allowed)


def test_binoculars_gather_49_mm_for_a_7_mm_pupil():
    assert BINOCULARS.collecting(7e-3) == pytest.approx(49e-3)
    assert BINOCULARS.collecting(10e-3) == pytest.approx(50e-3)
    assert NAKED.collecting(7e-3) == 7e-3
    beam, limits = LaserBeam(1.0, 0.78, 0.003, 1e-3), eye_limits(0.78, 100.0)
    # far away both are E * area: the distance grows by 7 times the root of the transmission
    ratio = hazard_zone(beam, limits, BINOCULARS)[1] / hazard_zone(beam, limits)[1]
    assert ratio == pytest.approx(7 * np.sqrt(0.9), rel=1e-3)


def test_a_gaussian_beam_is_that_of_the_optics():
    beam = LaserBeam.gaussian(0.01, 0.78, 0.005, quality=1.3)
    z = 250.0
    expected = 2 * gaussian_beam.radius(z, waist=0.005, wavelength=0.78e-6, quality=1.3)
    assert beam.diameter_at(z) == pytest.approx(float(expected), rel=1e-12)
    assert beam.quality == pytest.approx(1.3)


def test_a_sweep_s_pulse_is_what_a_pupil_integrates():
    rng = np.random.default_rng(3)
    for diameter, distance in ((0.002, 1.0), (0.006, 5.0), (0.02, 60.0)):
        beam = LaserBeam(0.01, 0.78, diameter, 1e-3)
        energy, duration = sweep_pulse(beam, distance, 0.4, aperture=7e-3)
        w, speed = 0.5 * beam.diameter_at(distance), 0.4 * distance
        # photons of the beam's cross-section, each crossing the pupil along its own chord
        y = rng.normal(0.0, 0.5 * w, 400_000)
        chords = 2 * np.sqrt(np.maximum(3.5e-3**2 - y**2, 0.0))
        u = chords.std() / np.sqrt(len(y)) * beam.power / speed
        assert energy == pytest.approx(beam.power * chords.mean() / speed, abs=4 * u)
        half = float(gaussian_beam.share_within(3.5e-3, w, 0.5 * duration * speed))
        assert half == pytest.approx(0.5 * float(gaussian_beam.share_within(3.5e-3, w)), rel=1e-9)


def test_a_narrow_beam_s_pulse_lasts_as_the_pupil_is_wide():
    energy, duration = sweep_pulse(LaserBeam(0.01, 0.78, 1e-4, 1e-2), 0.001, 1000.0, aperture=7e-3)  # 0.1 mm at 1 m/s
    assert duration == pytest.approx(7e-3, rel=1e-3)
    assert energy == pytest.approx(0.01 * 7e-3, rel=1e-3)


def test_a_wide_beam_s_pulse_lasts_as_the_beam_is_wide():
    beam = LaserBeam(0.01, 0.78, 0.5, 1e-3)
    energy, duration = sweep_pulse(beam, 10.0, 0.1, aperture=7e-3)
    w = 0.5 * beam.diameter_at(10.0)
    assert duration == pytest.approx(np.sqrt(2 * np.log(2)) * w / 1.0, rel=1e-3)
    peak = 2 * 0.01 / (np.pi * w**2) * PUPIL_AREA
    assert energy == pytest.approx(peak * np.sqrt(np.pi / 2) * w / 1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("count", "duration", "subtense", "total", "expected"),
    [
        (1, 1e-3, 50e-3, 100.0, 1.0),
        (1e6, 1e-3, 1.5e-3, 100.0, 1.0),  # points and long pulses: gone in 2014
        (600, 1e-6, 1.5e-3, 10.0, 1.0),
        (610, 1e-6, 1.5e-3, 10.0, 1.0),  # 5 * 610^(-1/4) is 1.006: a train is no safer than a pulse
        (1e4, 1e-6, 1.5e-3, 10.0, 0.5),
        (1e6, 1e-6, 1.5e-3, 10.0, 0.4),
        (1e6, 1e-6, 1.5e-3, 0.25, 1.0),
        (16, 0.1, 50e-3, 100.0, 0.5),
        (1e4, 0.1, 50e-3, 100.0, 0.4),
        (1e4, 1e-3, 50e-3, 100.0, 0.2),  # larger than alpha_max of 6.3 mrad
        (1e4, 1e-3, 200e-3, 100.0, 1.0),
        (1e4, 0.3, 50e-3, 100.0, 1.0),
    ],
)
def test_many_pulses_shrink_the_limit_as_the_edition_of_2014_says(count, duration, subtense, total, expected):
    assert repetition_factor(count, duration, subtense, wavelength_um=0.78, total=total) == pytest.approx(expected)


def test_a_sweep_is_never_worse_than_standing_and_slow_ones_become_it():
    beam = LaserBeam(0.05, 0.78, 0.01, 2e-4)
    standing = beam.power_within(7e-3, 20.0) / eye_limits(0.78, 100.0)[0].power
    ratios = [sweep_ratio(beam, 20.0, rate, duration=100.0, period=10.0) for rate in (1e-7, 1e-4, 1e-2, 1.0, 100.0)]
    assert ratios[0] == pytest.approx(standing)
    assert all(a >= b for a, b in pairwise(ratios))
    assert ratios[-1] < standing


def test_many_sweeps_count_by_their_average():
    # 1000 passes a second over a pupil at 100 m/s: far more than one pass allows on the average
    beam = LaserBeam(0.1, 0.78, 0.005, 2e-4)
    once = sweep_ratio(beam, 20.0, 5.0, duration=100.0)
    often = sweep_ratio(beam, 20.0, 5.0, duration=100.0, period=1e-3)
    energy, pulse = sweep_pulse(beam, 20.0, 5.0, aperture=7e-3)
    assert once == pytest.approx(energy / (18 * factors(0.78).c_a * pulse**0.75 * PUPIL_AREA), rel=1e-9)
    assert pulse < 1e-3
    assert often == pytest.approx(energy / 1e-3 / (14.4544 * PUPIL_AREA), rel=1e-5)
    assert often > once


def test_blue_sweeps_are_a_dose():
    beam = LaserBeam(0.01, 0.405, 0.005, 2e-4)
    energy, _ = sweep_pulse(beam, 10.0, 1.0, aperture=7e-3)
    found = sweep_ratio(beam, 10.0, 1.0, duration=100.0, period=0.01)
    assert found == pytest.approx(energy / 0.01 / (1.0 * PUPIL_AREA), rel=1e-6)


def test_a_longer_exposure_to_a_blue_sweep_is_not_safer():
    # one pass of 77 s: 1.25 times the dose of 100 s; spread over 30 000 s it would seem a sixth of what is allowed
    beam = LaserBeam(1e-4, 0.42, 0.003, 1e-3)
    short, long = (sweep_ratio(beam, 10.0, 1e-5, duration=t) for t in (100.0, 3e4))
    assert short == pytest.approx(1.25, abs=0.01)
    assert long >= short


def test_a_pass_that_began_within_the_exposure_counts_whole():
    # a dose: passes every 60 s are two within 100 s, not 1.67
    beam = LaserBeam(0.01, 0.405, 0.005, 2e-4)
    one, two = (sweep_ratio(beam, 10.0, 5e-5, duration=100.0, period=p) for p in (None, 60.0))
    assert two == pytest.approx(2.0 * one, rel=1e-9)


def test_no_sweep_is_worse_than_the_standing_beam():
    beam = LaserBeam(0.01, 0.78, 0.003, 1e-3)
    standing = beam.power_within(7e-3, 10.0) / eye_limits(0.78, 100.0)[0].power
    for rate in np.geomspace(1e-6, 1e-2, 30):
        for period in (None, 99.0, 60.0, 20.0):
            assert sweep_ratio(beam, 10.0, rate, duration=100.0, period=period) <= standing * (1 + 1e-12)


def test_at_700_nm_the_tables_of_the_infrared_hold():
    beam = LaserBeam(0.9e-3, 0.7, 0.002, 1e-3)
    assert "2" not in classify(beam).limits
    assert classify(beam).laser_class == "3R"
    assert class_limit("3R", 0.7, 100.0) == pytest.approx(2.0e-3)


def test_the_sweep_s_distance_is_where_it_reaches_its_limit():
    beam = LaserBeam(0.3, 0.78, 0.003, 1e-3)
    far = sweep_hazard_distance(beam, 0.5, duration=100.0)
    assert sweep_ratio(beam, far, 0.5, duration=100.0) == pytest.approx(1.0, rel=1e-6)
    assert sweep_ratio(beam, 1.01 * far, 0.5, duration=100.0) < 1.0
    assert sweep_hazard_distance(beam, 0.5, duration=100.0, viewer=BINOCULARS) > far
    assert sweep_hazard_distance(LaserBeam(0.1e-3, 0.78, 0.003, 1e-3), 0.5, duration=100.0) == 0.0
    assert far < hazard_zone(beam, eye_limits(0.78, 100.0))[1]


def test_the_returned_power_equals_that_of_the_unfolded_beam():
    # a large cube sends the beam on as if it had gone on: 1 - exp(-2 a^2/w^2) at twice the distance
    beam = LaserBeam.gaussian(0.01, 0.78, 0.008)
    w = float(gaussian_beam.radius(200.0, waist=0.008, wavelength=0.78e-6))
    expected = 0.01 * 0.92 * (1 - np.exp(-2 * (3.5e-3 / w) ** 2))
    assert returned_power(beam, 100.0, reflector=0.1, reflectance=0.92) == pytest.approx(expected, rel=1e-3)
    assert returned_power(beam, 100.0, reflector=0.1, viewer=BINOCULARS) > expected


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: eye_mpe(1.55, 10.0), "wavelength 1.55 um is outside 0.4-1.4 um"),
        (lambda: eye_mpe(0.39, 10.0), "wavelength 0.39 um"),
        (lambda: eye_mpe(float("nan"), 10.0), "wavelength nan um"),
        (lambda: eye_mpe(0.78, 4e4), "duration 40000 s is outside"),
        (lambda: eye_mpe(0.78, 10.0, 2.0), "subtense 2 rad"),
        (lambda: eye_mpe(0.78, 10.0, edition="ansi2007"), "edition 'ansi2007' is not one of iec2014, ansi2014"),
        (lambda: class_limit("2", 0.78, 0.25), "class 2 has no limit at 0.78 um"),
        (lambda: class_limit("5", 0.78, 0.25), "class 5 has no limit"),
        (lambda: LaserBeam(0.01, 0.78, 1e-3, 1e-4), "away is impossible (expected 0.9931 mrad or more"),
        (lambda: LaserBeam(0.01, 0.78, 1e-3, 1e-3, 5.0), "away is impossible"),
        (lambda: LaserBeam(0.01, 0.78, 1e-3, 50.0), "divergence = 50 rad is above 1 rad"),
        (lambda: sweep_hazard_distance(LaserBeam(1e-7, 0.78, 1e-3, 1e-3), -3.0, duration=1.0), "rate = -3 rad/s"),
        (lambda: LaserBeam(0.0, 0.78, 1e-3, 1e-3), "power = 0 W is not above 0"),
        (lambda: LaserBeam(0.01, 0.78, float("inf"), 1e-3), "diameter = inf m"),
        (lambda: LaserBeam(0.01, 0.78, 1e-3, 1e-3, float("nan")), "waist_distance = nan m"),
        (lambda: sweep_pulse(LaserBeam(0.01, 0.78, 1e-3, 1e-3), 0.0, 1.0, aperture=7e-3), "distance = 0 m"),
        (lambda: sweep_ratio(LaserBeam(0.01, 0.78, 1e-3, 1e-3), 1.0, 1.0, duration=1.0, period=0.0), "period = 0 s"),
        (lambda: returned_power(LaserBeam(0.01, 0.78, 0.02, 1e-3, 1.0), 9.0, reflector=0.05), "waist 1 m away"),
        (lambda: returned_power(LaserBeam(0.01, 0.78, 0.02, 1e-3), 9.0, reflector=0.1, reflectance=2), "reflectance 2"),
        (lambda: Viewer("glass", magnification=0.5), "glass: entrance inf m, magnification 0.5"),
    ],
)
def test_values_outside_are_refused_with_value_and_limit(call, said):
    with pytest.raises(ValidityError) as caught:
        call()
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_notice_is_a_warning():
    assert "not a certificate" in safety.NOTICE


def test_passes_beyond_t2_do_not_shrink_the_limit_of_one_any_further():
    """IEC 60825-1, 4.3 f 3: an extended source, seen for longer than T_2, is as dangerous as at T_2."""
    beam = LaserBeam(0.010, 0.780, 0.003, 1e-3)
    ratios = [sweep_ratio(beam, 10.0, 0.5, duration=t, period=0.3, subtense=0.01) for t in (25.0, 50.0, 99.0)]
    assert ratios == pytest.approx([ratios[0]] * 3, rel=1e-12)
    shorter = sweep_ratio(beam, 10.0, 0.5, duration=5.0, period=0.3, subtense=0.01)
    assert shorter < ratios[0]
