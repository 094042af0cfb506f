"""Zero and linearity against an interferometer: signs of every term, orders chosen, rank, air, drift, scatter."""

import numpy as np
import pytest

from calibration_scene import HALF, RUNS, WEATHER
from catseye.atmosphere.index.air import phase_refractivity
from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.ranging.air import phase_air
from catseye.reduction.calibrations.ranging.linearity import LAYOUT, calibrate_linearity
from catseye.reduction.calibrations.ranging.spectrum import spectrum
from catseye.signal.systematics.cyclic import cyclic_range

D0 = 0.180685
BASE = {**WEATHER, "d0_mm": D0 * 1e3, "u_interferometer_ppm": 0.0, "u_abbe_mm": 0.0}
START = {"start_m": 2.4, "u_start_mm": 1e-6}


def reads(distance, zero=0.0, scale=0.0, cosine=(), sine=()):
    """The range that shows, its cyclic deviation being that of the phase it shows itself."""
    range_ = zero + (1 + scale) * distance
    for _ in range(6):
        x = np.mod(-2 * np.pi * (range_ - D0) / HALF, 2 * np.pi)
        wave = sum(
            (c * np.cos(k * x) + s * np.sin(k * x) for k, (c, s) in enumerate(zip(cosine, sine, strict=True), start=1)),
            np.zeros(len(distance)),
        )
        range_ = zero + (1 + scale) * distance + wave
    return range_


def rail(span=1.5, m=80):
    return np.linspace(0.0, span, m)


def test_every_planted_term_comes_back_with_its_sign(table):
    length = rail()
    range_ = reads(2.4 + length, zero=35e-6, scale=3e-6, cosine=(6e-6, -2e-6), sine=(-9e-6, 1e-6))
    numbers = {"range_m": range_, "interferometer_m": length}
    found = calibrate_linearity(table(LAYOUT, numbers, **BASE, **START, u_range_mm=1e-5, orders=2))
    assert found.value("zero_mm") == pytest.approx(35e-3, abs=1e-6)
    assert found.value("scale_ppm") == pytest.approx(3.0, abs=1e-3)
    assert found.record["cyclic_cosine_mm"] == pytest.approx([6e-3, -2e-3], abs=1e-6)
    assert found.record["cyclic_sine_mm"] == pytest.approx([-9e-3, 1e-3], abs=1e-6)
    # What the ranger's record then takes off is what was planted.
    x = np.mod(-2 * np.pi * (range_ - D0) / HALF, 2 * np.pi)
    taken = cyclic_range(
        x, np.array(found.record["cyclic_cosine_mm"]) / 1e3, np.array(found.record["cyclic_sine_mm"]) / 1e3
    )
    np.testing.assert_allclose(range_ - taken, 35e-6 + (1 + 3e-6) * (2.4 + length), atol=2e-9)


def test_by_hand_with_numpy(table):
    rng = np.random.default_rng(0)
    length = rail()
    range_ = reads(2.4 + length, zero=1e-5, cosine=(5e-6,), sine=(3e-6,)) + 1e-6 * rng.standard_normal(80)
    numbers = {"range_m": range_, "interferometer_m": length}
    found = calibrate_linearity(table(LAYOUT, numbers, **BASE, orders=1))
    x = -2 * np.pi * (range_ - D0) / HALF
    middle = length - length.mean()
    design = np.column_stack([np.ones(80), middle, np.cos(x), np.sin(x)])
    by_hand, squares, *_ = np.linalg.lstsq(design, range_ - length, rcond=None)
    assert found.quantities[0].key == "offset_mm"
    assert [q.value for q in found.quantities] == pytest.approx(by_hand * [1e3, 1e6, 1e3, 1e3], rel=1e-5)
    variance = squares[0] / 76 * np.linalg.inv(design.T @ design)
    assert found.u("cyclic_cosine_1_mm") == pytest.approx(1e3 * np.sqrt(variance[2, 2]), rel=1e-4)


def test_without_a_start_the_zero_is_not_claimed(table):
    numbers = {"range_m": reads(2.4 + rail()), "interferometer_m": rail()}
    found = calibrate_linearity(table(LAYOUT, numbers, **BASE, u_range_mm=1e-3))
    assert "zero_mm" not in [q.key for q in found.quantities]
    with pytest.raises(InputError, match="u_start_mm is missing"):
        calibrate_linearity(table(LAYOUT, numbers, **BASE, start_m=2.4))


@pytest.mark.parametrize("planted", [0, 1, 2, 3])
def test_the_orders_that_are_there_are_chosen(table, planted):
    rng = np.random.default_rng(planted)
    range_ = reads(2.4 + rail(), cosine=(4e-6,) * planted, sine=(-3e-6,) * planted) + 1e-6 * rng.standard_normal(80)
    found = calibrate_linearity(table(LAYOUT, {"range_m": range_, "interferometer_m": rail()}, **BASE))
    assert len(found.record.get("cyclic_cosine_mm", ())) == planted


@pytest.mark.parametrize("runs", RUNS)
def test_an_order_is_taken_in_vain_once_in_twenty_times(table, runs):
    rng, taken = np.random.default_rng(11), 0
    sheet = {**BASE, "u_range_mm": 1e-3}
    for _ in range(runs):
        range_ = reads(2.4 + rail(m=40)) + 1e-6 * rng.standard_normal(40)
        found = calibrate_linearity(table(LAYOUT, {"range_m": range_, "interferometer_m": rail(m=40)}, **sheet))
        taken += bool(found.record)
    assert taken / runs == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / runs))


def test_a_rail_below_half_a_wavelength_leaves_cyclic_terms_out_with_the_reason(table):
    length = rail(0.02, 30)
    numbers = {"range_m": reads(2.4 + length, cosine=(8e-6,), sine=(0.0,)), "interferometer_m": length}
    found = calibrate_linearity(table(LAYOUT, numbers, **BASE, u_range_mm=1e-3))
    assert [q.key for q in found.quantities] == ["offset_mm", "scale_ppm"]
    assert "positions cover 0.02 m, less than half a modulation wavelength (0.09991 m)" in found.notes[0]
    assert "and is not in its u" in found.notes[0]
    held = calibrate_linearity(table(LAYOUT, numbers, **BASE, u_range_mm=1e-3, u_cyclic_mm=0.01))
    assert held.u("offset_mm") > 5 * found.u("offset_mm")
    assert "u_cyclic_mm = 0.01 as prior" in held.notes[0]


def test_positions_a_half_wavelength_apart_show_one_phase_and_no_cyclic_term(table):
    length = HALF * np.arange(20)
    numbers = {"range_m": reads(2.4 + length, cosine=(8e-6,), sine=(0.0,)), "interferometer_m": length}
    found = calibrate_linearity(table(LAYOUT, numbers, **BASE, u_range_mm=1e-3))
    assert not found.record
    assert "do not separate them" in found.notes[0]


def test_an_interferometer_in_vacuum_lengths_is_brought_to_its_air(table):
    length, light = rail(), 0.63299
    index = 1 + float(phase_refractivity(20.0, 933.0, 50.0, wavelength_um=light, model="rueger1990"))
    sheet = {**BASE, **START, "interferometer_wavelength_um": light, "u_range_mm": 1e-4, "max_order": 0}
    numbers = {"range_m": reads(2.4 + length), "interferometer_vacuum_m": length * index}
    found = calibrate_linearity(table(LAYOUT, numbers, **sheet))
    assert found.value("scale_ppm") == pytest.approx(0.0, abs=1e-5)
    with pytest.raises(InputError, match="interferometer_wavelength_um is missing"):
        calibrate_linearity(table(LAYOUT, numbers, **{**sheet, "interferometer_wavelength_um": None}))


def test_a_dead_path_follows_the_air(table):
    # The carriage stands still at its zero while the air warms by 2 °C: the fringes of the dead path are not motion.
    light, dead, warm = 0.63299, 1.5, np.linspace(20.0, 22.0, 12)
    n = 1 + np.array([float(phase_refractivity(t, 933.0, 50.0, wavelength_um=light, model="rueger1990")) for t in warm])
    length = 0.02 * np.arange(12)
    vacuum = n * (length + dead) - n[0] * dead
    weather = {k: v for k, v in WEATHER.items() if k != "temperature_c"}
    sheet = {**BASE, **weather, "interferometer_wavelength_um": light, "u_range_mm": 1e-4, "max_order": 0}
    del sheet["temperature_c"]
    numbers = {"range_m": 2.4 + length, "interferometer_vacuum_m": vacuum, "temperature_c": warm}
    found = calibrate_linearity(table(LAYOUT, numbers, **sheet, dead_path_m=dead))
    assert found.value("scale_ppm") == pytest.approx(0.0, abs=1e-4)
    without = calibrate_linearity(table(LAYOUT, numbers, **sheet))
    assert abs(without.value("scale_ppm")) > 5.0


def test_one_thermometer_for_both_cancels_but_for_the_ranger_s_longer_path(table):
    light, length = 0.63299, rail()
    index = 1 + float(phase_refractivity(20.0, 933.0, 50.0, wavelength_um=light, model="rueger1990"))
    sheet = {**BASE, **START, "interferometer_wavelength_um": light, "u_range_mm": 1e-5, "u_temperature_c": 1.0}
    both = calibrate_linearity(
        table(LAYOUT, {"range_m": reads(2.4 + length), "interferometer_vacuum_m": length * index}, **sheet)
    )
    one = calibrate_linearity(table(LAYOUT, {"range_m": reads(2.4 + length), "interferometer_m": length}, **sheet))
    formula = 1.5e-7  # scale of the formulas' own doubt, which stays
    assert one.u("scale_ppm") == pytest.approx(0.896, rel=0.05)  # P 1.50, of the whole index
    assert both.u("scale_ppm") < 0.1 + 1e6 * formula * 2


def test_a_grossly_wrong_reading_is_rejected_on_request(table):
    rng = np.random.default_rng(5)
    range_ = reads(2.4 + rail(), cosine=(5e-6,), sine=(5e-6,)) + 1e-6 * rng.standard_normal(80)
    range_[33] -= 3e-5
    readings = table(LAYOUT, {"range_m": range_, "interferometer_m": rail()}, **BASE, u_range_mm=1e-3)
    plain, without = calibrate_linearity(readings), calibrate_linearity(readings, reject=True)
    assert plain.rows[33][-1] == "suspect"
    assert [k for k, row in enumerate(without.rows) if row[-1] == "rejected"] == [33]
    assert without.rows[33][4] == pytest.approx(-30.0, abs=4.0)


def test_an_unmodelled_order_shows_in_the_spectrum_of_residuals(table):
    rng = np.random.default_rng(6)
    length = rail(m=120)
    range_ = reads(2.4 + length, cosine=(0.0, 0.0, 4e-6), sine=(0.0,) * 3) + 1e-6 * rng.standard_normal(120)
    numbers = {"range_m": range_, "interferometer_m": length}
    found = calibrate_linearity(table(LAYOUT, numbers, **BASE, u_range_mm=1e-3, orders=1))
    line = next(d for d in found.decisions if d.name.startswith("spectrum"))
    assert line.passed is False
    period, height, chance = found.curve["spectrum"][0], found.curve["spectrum"][1], line.statistic
    assert period[np.argmax(height)] == pytest.approx(HALF / 3 * 1e3, rel=0.02)
    assert height.max() == pytest.approx(4.0, rel=0.15)
    assert chance < 1e-6


def test_the_spectrum_takes_a_claimed_drift_for_no_line():
    rng = np.random.default_rng(7)
    position, runs = np.linspace(0.0, 1.5, 60), 200
    walk = np.minimum(np.arange(60)[:, None], np.arange(60)) + 0.5 * np.eye(60)
    lower = np.linalg.cholesky(walk)
    alarms = 0
    for _ in range(runs):
        chance = spectrum(position, lower @ rng.standard_normal(60), walk, half=HALF)[2]
        alarms += chance.min() < 0.05
    assert alarms / runs < 0.05 + 4 * np.sqrt(0.05 / runs)
    assert alarms > 0
    blind = [spectrum(position, lower @ rng.standard_normal(60), np.eye(60), half=HALF)[2].min() for _ in range(20)]
    assert np.mean(np.array(blind) < 0.05) > 0.9


@pytest.mark.parametrize("runs", RUNS)
def test_all_terms_scatter_as_claimed(table, scatters_as_claimed, runs):
    rng, values, covariances = np.random.default_rng(8), [], []
    m, length = 40, rail(m=40)
    mjd = 61_280.0 + np.arange(m) / 24 / 20
    sheet = {**BASE, "start_m": 2.4, "u_start_mm": 0.005, "u_range_mm": 0.0015, "u_interferometer_ppm": 0.8}
    sheet |= {"random_walk_mm_per_sqrt_hour": 0.002, "orders": 2}
    truth = [0.03, 1.0, 6e-3, -2e-3, -9e-3, 1e-3]
    for _ in range(runs):
        walk = np.cumsum(np.concatenate([[0.0], 2e-6 * np.sqrt(1 / 20) * rng.standard_normal(m - 1)]))
        distance = 2.4 + 5e-6 * rng.standard_normal() + length * (1 + 0.8e-6 * rng.standard_normal())
        range_ = reads(distance, zero=30e-6, scale=1e-6, cosine=(6e-6, -2e-6), sine=(-9e-6, 1e-6))
        range_ = range_ + walk + 1.5e-6 * rng.standard_normal(m)
        numbers = {"range_m": range_, "interferometer_m": length, "mjd_utc": mjd}
        found = calibrate_linearity(table(LAYOUT, numbers, **sheet))
        values.append([q.value for q in found.quantities])
        covariances.append(found.covariance)
    scatters_as_claimed(values, covariances, truth)


def test_weather_at_the_ends_of_its_scales_has_slopes_from_the_side_that_there_is(table):
    ends = {"temperature_c": [-40.0, 20.0, 50.0], "pressure_hpa": [900.0] * 3, "humidity_percent": [0.0, 50.0, 100.0]}
    inside = {"temperature_c": [-39.5, 20.0, 49.5], "pressure_hpa": [900.0] * 3, "humidity_percent": [0.5, 50.0, 99.5]}
    sheet = {key: value for key, value in BASE.items() if key not in ends}
    numbers = {"range_m": [3.0, 4.0, 5.0], "interferometer_vacuum_m": [0.6, 1.6, 2.6]}
    at, near = (phase_air(table(LAYOUT, {**numbers, **w}, **sheet), 0.633).slopes for w in (ends, inside))
    assert at == pytest.approx(near, rel=0.08)  # over half a degree that of humidity grows by 5 % at -40 °C


def test_readings_that_agree_to_the_last_digit_are_reported(table):
    length = np.arange(0.0, 3.0, 0.03)
    with pytest.raises(EstimationError, match="do not scatter at all"):
        calibrate_linearity(table(LAYOUT, {"range_m": 2.4 + length, "interferometer_m": length}, **BASE, **START))
