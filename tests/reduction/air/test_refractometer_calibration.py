"""A night of a path: followed, calibrated, its claimed uncertainty held against scatter. The twin shares no formula."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from catseye.atmosphere.index.air import group_refractivity
from catseye.errors import EstimationError, InputError
from catseye.reduction.air.group_index import phase_slope
from catseye.reduction.air.refractometer_calibration import calibrate_path
from catseye.reduction.air.refractometer_night import read_path_readings, read_path_sheet
from reduction.air.refractometer_scene import PathPlan, simulate_path_night

NOISY = PathPlan(strays=0.03, patch_c=0.0, drift_mrad_per_hour=0.2)  # random walk of 0.5 mrad a root hour besides


def read(file, **changes):
    sheet, hashes = read_path_sheet(file.with_suffix(".toml"), changes)
    return read_path_readings(file, sheet, hashes)


@pytest.fixture
def night(tmp_path):
    """Function (seed, plan, sheet) -> simulated night and its calibration by way of the files."""

    def made(seed, plan, **sheet):
        simulated = simulate_path_night(seed, plan)
        return simulated, calibrate_path(read(simulated.write(tmp_path / f"n{seed}.csv", **sheet)))

    return made


def planted_index(simulated, found):
    """Refractivity at which the electronics of mjd_0 and noiseless light would have given phase_0."""
    k = -float(phase_slope(simulated.plan.path_length))
    rows = np.isfinite(found.refractivity) & (found.followed.section == 0)
    free = found.followed.phase[rows] - simulated.electronics[rows] - found.phase_0
    electronics = np.interp(found.mjd_0, simulated.mjd_utc, simulated.electronics)
    return float(np.mean(simulated.index[rows] + free / k) + electronics / k)


def errors(night, seeds, plan):
    """Error of the calibration and its claimed u, ppm; the twin's air is the model's, so that its u takes no part."""
    found = []
    for seed in seeds:
        simulated, c = night(seed, plan)
        u = np.sqrt(c.u_index_0**2 - c.budget["formula"] ** 2)
        found.append((c.index_0 - planted_index(simulated, c), u))
    return np.array(found).T * 1e6


def test_calibration_recovers_a_planted_index_to_0_05_ppm_and_its_u_holds(night):
    error, u = errors(night, range(24), NOISY)
    assert np.sqrt(np.mean(error**2)) < 0.05
    # 24 draws: chi-square / 24 lies within 0.47 to 1.76 in 98 % of all seeds
    assert 0.47 < np.mean((error / u) ** 2) < 1.76


@pytest.mark.slow
@pytest.mark.parametrize("plan", [NOISY, dataclasses.replace(NOISY, strays=0.0, walk_mrad_per_root_hour=0.0,
                                                             drift_mrad_per_hour=0.0)])  # fmt: skip
def test_the_claimed_u_of_the_calibration_is_its_scatter(night, plan):
    error, u = errors(night, range(300), plan)
    assert np.sqrt(np.mean(error**2)) < 0.05
    # 300 draws scatter by 8 % in chi-square; thermometers that happen to lie apart count for more than they should
    assert 0.75 < np.mean((error / u) ** 2) < 1.25


def test_every_phase_of_the_night_gives_the_index_within_its_u(night):
    simulated, c = night(3, NOISY)
    good = np.isfinite(c.refractivity)
    assert good.sum() > 0.9 * len(simulated.index)
    z = (c.refractivity - simulated.index)[good] / c.u_refractivity[good]
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.3  # one night: its offsets are drawn once
    assert np.max(np.abs(z)) < 6.0  # strays would stand a hundred off
    warm, u = c.temperature_c[good], c.u_temperature_c[good]
    per_c = -0.95e-6  # ppm a °C, to a few per cent here
    assert np.nanmedian(u) < 0.2
    true_at = np.nanmean(simulated.temperature_c[good], axis=1) + (simulated.index - c.weather.mean)[good] / per_c
    assert np.nanmedian(np.abs(warm - true_at)) < 0.2


def test_outliers_are_named_and_wrong_weather_does_not_lose_the_phase(night):
    simulated, c = night(5, NOISY)
    status = np.array(c.status)
    # a foreign phase within 5 sigma, some 5 mrad of 2 pi, stays: here none does
    assert set(status[simulated.wrong_phase]) == {"stray"}
    wrong = simulated.wrong_weather & ~simulated.wrong_phase
    assert wrong.sum() > 3
    assert np.all(np.isfinite(c.refractivity[wrong]))
    assert (status == "stray").sum() <= simulated.wrong_phase.sum() + 2


def test_without_drift_and_systematics_it_is_the_mean_and_the_slope_is_the_regressions(night):
    plan = PathPlan(walk_mrad_per_root_hour=0.0, patch_c=0.0, thermometers=1, phase_noise=1e-5)
    _, c = night(8, plan, u_temperature_c=0.0, u_pressure_hpa=0.0, u_humidity_percent=0.0, u_path_length_mm=0.0)
    used = np.array(c.status) == "good"
    phase, weather = c.followed.phase[used], c.weather.mean[used]
    k = -float(phase_slope(plan.path_length))
    # readings weigh by the slope of the index, which differs by 4 % over the night
    assert c.index_0 == pytest.approx(np.mean(weather + (phase - c.phase_0) / k), abs=0.002e-6)
    plain = stats.linregress(phase, weather)
    assert c.slope.ratio == pytest.approx(-plain.slope * k, abs=0.1 * c.slope.u)
    # eddies of 120 s are 69 % of the variance: 1 + 2 x 0.69 x 0.61/0.39 = 3.1 readings hang together
    assert c.correlation == pytest.approx(3.1, rel=0.35)
    assert c.slope.u == pytest.approx(plain.stderr * k * np.sqrt(c.correlation), rel=0.15)


def test_a_phase_of_the_wrong_sign_is_found_out_by_its_slope(night, tmp_path):
    simulated = simulate_path_night(9, PathPlan(patch_c=0.0))
    turned = dataclasses.replace(simulated, phase=np.mod(-simulated.phase, 2.0 * np.pi))
    c = calibrate_path(read(turned.write(tmp_path / "n.csv"), drift_mrad_per_root_hour=0.0))
    assert c.slope.agrees is False
    assert c.slope.ratio == pytest.approx(-1.0, abs=0.1)
    assert any("phase and weather disagree" in note for note in c.notes)
    _, right = night(9, PathPlan(patch_c=0.0))
    assert right.slope.agrees is True


def test_a_jump_of_the_path_begins_a_section_and_reports_its_size(night):
    for size in (0.0003, -0.0003, 0.00006):  # the last, 4 mrad, is less than five u of a single reading
        simulated, c = night(11, PathPlan(jumps={4.0: size}, patch_c=0.0))
        assert [s.reason for s in c.followed.sections] == ["start", "jump"]
        where = c.readings.hours[c.followed.sections[1].first]
        assert where == pytest.approx(4.0, abs=0.06)
        said = float(c.followed.sections[1].text.split(" as ")[1].split()[0])
        assert said == pytest.approx(size * 1e3, abs=0.015)  # mm: 1 mrad of a level is 8 um
        good = np.isfinite(c.refractivity)
        assert np.sqrt(np.mean((c.refractivity - simulated.index)[good] ** 2)) < 0.3e-6


def test_air_that_slowly_leaves_the_thermometers_is_no_jump(tmp_path):
    """A drainage flow, 2 °C colder on the path alone for an hour: the phase follows it, and the index with it."""
    simulated = simulate_path_night(7, PathPlan(patch_c=0.0, eddies_c=0.0, walk_mrad_per_root_hour=0.0))
    k = -float(phase_slope(simulated.plan.path_length))
    hours = (simulated.mjd_utc - simulated.mjd_utc[0]) * 24.0
    more = 2e-6 * np.exp(-0.5 * ((hours - 4.0) / 0.4) ** 2)
    flow = dataclasses.replace(simulated, phase=np.mod(simulated.phase - k * more, 2.0 * np.pi))
    c = calibrate_path(read(flow.write(tmp_path / "n.csv")))
    assert [s.reason for s in c.followed.sections] == ["start"]
    z = (c.refractivity - simulated.index - more) / c.u_refractivity
    assert np.nanmax(np.abs(z)) < 5.0


def test_a_gap_is_bridged_by_the_weather_or_named_as_ambiguous(night):
    """The weather is good to a quarter cycle at 5 sigma over 100 m and 3 hours, over 20 km it is not."""
    gap = ((3.0, 6.0),)
    _, short = night(12, PathPlan(gaps=gap))
    assert [s.reason for s in short.followed.sections] == ["start"]
    assert any("was bridged by the weather" in note for note in short.notes)
    plan = PathPlan(path_length=20000.0, gaps=gap, thermometers=5, noise_c=0.02, eddies_c=0.02, patch_c=0.0)
    simulated, far = night(12, plan)
    assert [s.reason for s in far.followed.sections] == ["start", "ambiguous gap"]
    assert any("whole cycles are not connected" in note for note in far.notes)
    good = np.isfinite(far.refractivity)  # each section stands on its own weather
    assert set(far.followed.section[good]) == {0, 1}
    assert np.max(np.abs(far.refractivity - simulated.index)[good]) < 0.2e-6


def test_a_faint_reading_is_passed_over_and_ends_no_section(night, tmp_path):
    """0.35 rad of one phase: five of it are more than a quarter cycle, of which its neighbours know nothing."""
    _, right = night(20, PathPlan(patch_c=0.0))
    readings = read(tmp_path / "n20.csv")
    u = readings.u_phase.copy()
    u[[0, 100, 150]] = 0.35
    c = calibrate_path(dataclasses.replace(readings, u_phase=u))
    assert [s.reason for s in c.followed.sections] == ["start"]
    assert [c.status[k] for k in (0, 100, 150)] == ["stray"] * 3
    assert np.max(np.abs(c.followed.phase - right.followed.phase)) < 1e-9
    good = np.isfinite(c.refractivity)
    assert np.max(np.abs(c.refractivity - right.refractivity)[good]) < 0.02e-6


def test_a_long_path_without_weather_for_hours_stays_a_few_sections(night):
    """Over 5 km the air walks a quarter cycle in 20 minutes without weather; it is not a section a reading."""
    plan = PathPlan(path_length=5000.0, noise_c=0.02, eddies_c=0.02, patch_c=0.0, weather_gaps=((2.0, 4.5),))
    simulated, c = night(3, plan)
    assert len(c.followed.sections) == 1
    good = np.isfinite(c.refractivity)
    assert good.sum() > 300
    assert np.max(np.abs(c.refractivity - simulated.index)[good]) < 0.2e-6


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_the_ratio_is_above_one_where_the_paths_air_changes_less_than_the_sensors(tmp_path, share):
    """Phases made of half, or twice, the change that the sensors read; the reverse of it is the ratio."""
    simulated = simulate_path_night(9, PathPlan(patch_c=0.0, walk_mrad_per_root_hour=0.0))
    k = -float(phase_slope(simulated.plan.path_length))
    less = (1.0 - share) * k * (simulated.index - simulated.index.mean())
    turned = dataclasses.replace(simulated, phase=np.mod(simulated.phase + less, 2.0 * np.pi))
    c = calibrate_path(read(turned.write(tmp_path / "n.csv")))
    assert c.slope.agrees is False
    assert c.slope.ratio == pytest.approx(1.0 / share, rel=0.1)
    assert any("above 1 the path's air changes less" in note for note in c.notes)


def test_the_calibration_reports_the_weather_of_its_index(night):
    """With a jump: n_g(t0, h0, p0) and phase_0 are of the first section, not of the night, 2 ppm away."""
    _, c = night(11, PathPlan(jumps={4.0: 0.0003}, patch_c=0.0))
    assert len(c.followed.sections) == 2
    by_weather = float(
        group_refractivity(c.temperature_0_c, c.pressure_0_hpa, c.humidity_0_percent, model="rueger1990")
    )
    # mean of the index against the index of the mean: some hundredths of a ppm over 3 °C
    assert by_weather == pytest.approx(c.index_0, abs=0.15e-6)
    half = c.readings.mjd_utc[c.followed.section == 0]
    assert half[0] < c.mjd_0 < half[-1]


def test_turns_of_a_long_path_are_unwrapped(night):
    """Over 5 km a ppm is 0.31 rad: the night's 10 ppm go round."""
    plan = PathPlan(path_length=5000.0, noise_c=0.02, eddies_c=0.02, patch_c=0.0)
    simulated, c = night(13, plan)
    assert np.ptp(c.followed.phase) > 2.5
    assert np.max(np.abs(np.diff(simulated.phase))) > 3.0  # it did wrap in the file
    good = np.isfinite(c.refractivity)
    assert good.all()
    assert np.max(np.abs(c.refractivity - simulated.index)) < 0.2e-6


def test_phases_without_weather_get_their_index_too(night):
    simulated, c = night(14, PathPlan(weather_gaps=((2.0, 4.0),)))
    blank = np.isnan(simulated.pressure_hpa)
    assert blank.sum() == 120
    assert set(np.array(c.status)[blank]) == {"no weather"}
    assert np.max(np.abs(c.refractivity - simulated.index)[blank]) < 6.0 * c.u_refractivity[blank].max()
    assert np.all(np.isnan(c.temperature_c[blank]))


def test_offsets_of_sensors_do_not_average_out(night):
    _, c = night(15, PathPlan(patch_c=0.0), u_temperature_c=0.3, u_pressure_hpa=1.0)
    # 0.3 °C of five thermometers and 1 hPa, common to all 480 readings: 0.95 and 0.285 ppm for each unit
    assert c.budget["thermometers"] == pytest.approx(0.95e-6 * 0.3 / np.sqrt(5), rel=0.03)
    assert c.budget["barometer"] == pytest.approx(0.285e-6, rel=0.02)
    assert np.sqrt(sum(p**2 for p in c.budget.values())) == pytest.approx(c.u_index_0, rel=1e-9)


def test_a_biased_barometer_does_not_move_the_mean_temperature(night, tmp_path):
    """It moves the calibration by as much as the inversion: 1 hPa is 0.3 °C, and cancels."""
    simulated = simulate_path_night(16, PathPlan(patch_c=0.0, walk_mrad_per_root_hour=0.0))
    wrong = dataclasses.replace(simulated, pressure_hpa=simulated.pressure_hpa + 5.0)
    right = calibrate_path(read(simulated.write(tmp_path / "a.csv")))
    moved = calibrate_path(read(wrong.write(tmp_path / "b.csv")))
    assert moved.index_0 - right.index_0 == pytest.approx(5.0 * 0.285e-6, rel=0.02)
    good = np.isfinite(right.temperature_c)
    np.testing.assert_allclose(moved.temperature_c[good], right.temperature_c[good], atol=0.02)
    # 0.02: 5 hPa move the index by 1 % less where it is 3 °C warmer than at the mean
    vague = calibrate_path(read(wrong.write(tmp_path / "c.csv", u_pressure_hpa=5.0)))
    np.testing.assert_allclose(vague.temperature_c[good], right.temperature_c[good], atol=0.03)
    assert np.median(vague.u_temperature_c[good]) < 0.3  # 5 hPa would be 1.5 °C if it did not cancel


def test_a_drift_of_the_electronics_is_found_with_its_sign(night):
    """1 mrad an hour, 0.16 ppm an hour at 100 m, that the weather does not show."""
    plan = PathPlan(patch_c=0.0, drift_mrad_per_hour=1.0, walk_mrad_per_root_hour=0.0)
    simulated, c = night(19, plan, drift_mrad_per_root_hour=2.0)
    last = c.names[-1]
    value, u = c.of(last)
    assert last.startswith("drift at 7.9")
    assert value == pytest.approx(simulated.electronics[-1], abs=4.0 * u)
    assert 0.0 < u < 0.002


def test_a_certified_length_gives_the_absolute_index_and_the_weather_a_length(night):
    simulated, c = night(17, PathPlan(patch_c=0.0, walk_mrad_per_root_hour=0.0), u_path_length_mm=0.02)
    assert float(c.absolute.group_index) - 1.0 == pytest.approx(planted_index(simulated, c), abs=0.1e-6)
    assert float(c.absolute.u) == pytest.approx(0.2e-6, rel=0.2)
    assert c.path_length == pytest.approx(simulated.plan.path_length, abs=4 * c.u_path_length)
    _, vague = night(17, PathPlan(patch_c=0.0), u_path_length_mm=25.0)
    assert np.isnan(vague.absolute.group_index)
    assert np.isnan(vague.path_length)


def test_thermometers_far_apart_count_for_less(night):
    _, near = night(18, PathPlan(patch_c=0.0))
    _, apart = night(18, PathPlan(patch_c=3.0))
    assert near.places < 2.0
    assert apart.places > 5.0
    assert apart.budget["thermometers"] > 4.0 * near.budget["thermometers"]


def test_too_little_is_refused_in_one_line(night, tmp_path):
    with pytest.raises(InputError, match=r"4 readings with weather \(expected at least 5\)"):
        night(1, PathPlan(hours=4 / 60))
    plan = PathPlan(hours=0.2, jumps={0.05: 0.02, 0.1: 0.04, 0.15: 0.02})
    simulated = simulate_path_night(2, plan)
    blank = simulated.temperature_c.copy()
    blank[2:9] = np.nan
    with pytest.raises(EstimationError, match="no section of the phase has 5 readings"):
        calibrate_path(read(dataclasses.replace(simulated, temperature_c=blank).write(tmp_path / "n.csv")))
