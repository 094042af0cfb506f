"""The whole reduction of a triplet's sheet: numbers, combination of placements, acceptance."""

import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, norm

from catseye.gateways.triplet.figure import triplet_figure
from catseye.gateways.triplet.objects import triplet_object
from catseye.gateways.triplet.sheet import text_sheet
from catseye.gateways.writers.drawing import svg as svg_of
from catseye.gateways.writers.objects import plain
from catseye.optics.retroreflector import cats_eye, prism
from catseye.records.files.reading import read_record
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from catseye.reduction.triplet.geometry import half_wavelengths
from catseye.reduction.triplet.result import TOLERANCE, conformity_probability
from catseye.reduction.triplet.unit import combined, reduce_triplet, triplet_readings
from repository import TESTS
from triplet_scene import SHEET, N, document, measurement, noisy_unit

VECTOR = tomllib.loads((TESTS / "vectors" / "triplet.toml").read_text(encoding="utf-8"))
EXAMPLES = SHEET.parent


def reduced(name):
    return reduce_triplet(read_record(EXAMPLES / f"{name}.toml", TripletMeasurement))


def truth_of(name):
    first = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8").splitlines()[0]
    return float(first.split("h_corr = ")[1].split()[0]) * 1e-3


def test_the_layouts_example_gives_its_truth():
    want, found = VECTOR["sheet"], reduced("TR99")
    np.testing.assert_allclose(found.h * 1e3, want["h_corr_mm"], atol=want["tolerance_mm"])
    assert found.h_corr * 1e3 == pytest.approx(want["h_corr_mm"], abs=want["tolerance_mm"])
    assert found.l_mpbc * 1e3 == pytest.approx(want["h_corr_mm"], abs=1e-9)
    assert found.cycles.n_1.tolist() == want["n_1"]
    assert found.cycles.n_bc.tolist() == want["n_bc"]
    assert found.accepted
    assert found.status == ("good",) * 3


def test_the_memos_design_values_to_their_printed_digits():
    memo = VECTOR["memo"]
    found = reduced("TR99")
    design = reduce_triplet(measurement(placement__0__temperature_c=20.0, placement__0__pressure_hpa=933.0,
                                        placement__0__humidity_percent=50.0))  # fmt: skip
    assert int(1e3 * 299792458 / 2 / found.measurement.modulation_hz * 1e6) / 1e6 == memo["hwlv_mm"]
    assert int(design.readings.eta_a[0] * 1e8) / 1e8 == memo["eta_a"]
    half, _ = half_wavelengths(design.readings)
    assert half[0] * 1e3 == pytest.approx(99.930819330 / 1.000253246815, abs=1e-6)
    assert found.cycles.n_1[0] == memo["n_1"]
    assert float(prism.range_constant(38.4, N)) == pytest.approx(memo["pc_prism_mm"], abs=0.05)
    assert float(prism.reference_depth(38.4, N)) == pytest.approx(memo["hrp_mm"], abs=5e-4)
    assert float(cats_eye.range_constant(1.969 * 25.4, 3.799 * 25.4, N)) == pytest.approx(memo["pc_ball_mm"], abs=5e-4)


@pytest.mark.parametrize("name", ["TR01", "TR02", "TR03", "TR06"])
def test_the_examples_are_found_within_three_u(name):
    found = reduced(name)
    assert abs(found.h_corr - truth_of(name)) < 3.0 * found.u_h_corr
    assert found.accepted
    assert found.suspects == ()


def test_a_unit_with_a_wrong_shell_is_refused():
    found = reduced("TR04")
    # R2 is 0.2 mm larger than the sheet says: the light goes n 0.2 mm farther
    assert found.difference == pytest.approx(N * 0.2e-3, abs=4.0 * found.u_difference)
    assert not found.accepted
    assert found.conformity_probability < 1e-10


def test_a_misread_placement_is_named_and_kept():
    found = reduced("TR05")
    assert found.suspects == (4,)
    assert found.status[4] == "suspect"
    # 0.02 rad of 2 pi times 99.9 mm; a phase read too high is a range too short: the ball too near, H_corr too low
    assert found.h[4] - found.h[:4].mean() == pytest.approx(-0.02 / (2 * np.pi) * 0.0999, abs=4e-5)
    assert found.p < 1e-6
    assert abs(found.h_corr_without_suspects - truth_of("TR05")) < 3.0 * found.u_h_corr
    assert found.weights[4] == pytest.approx(0.2, abs=0.01)


def test_a_slip_of_the_memos_rule_is_noted():
    found = reduced("TR06")
    assert found.cycles.n_1[0] == found.memo.n_1[0] + 1
    # one half wavelength in both prisms, none in the ball: H_corr off by 99.9 mm
    assert found.memo.h_corr_by_int[0] - found.h[0] == pytest.approx(0.0999, abs=2e-4)
    assert any("the memo's INT rule gives N_1 = 180 for 181" in note for note in found.notes)


def test_the_air_of_the_flip_counts_for_the_ball():
    """A warmer flip: 1 deg C is 0.9e-6 of 18.3 m of path to the ball, in air metres, unless the sheet tells of it."""
    quiet = reduce_triplet(measurement())
    told = reduce_triplet(measurement(placement__0__temperature_flipped_c=21.4))
    # thinner air: the same phase is a longer way, so the ball is farther off and higher on its unit
    path = told.lengths.d_bcfp[0] - told.readings.pc_b
    assert told.h[0] - quiet.h[0] == pytest.approx(0.894e-6 * path, rel=0.01)
    assert told.h[1] == quiet.h[1]


def test_a_reference_read_again_moves_only_the_ball():
    quiet = reduce_triplet(measurement())
    told = reduce_triplet(measurement(placement__0__phi_zrg_flipped_rad=2.31))
    half = half_wavelengths(told.readings)[1][0]
    assert told.h[0] - quiet.h[0] == pytest.approx(0.01 / (2 * np.pi) * half, rel=1e-6)
    # a second reading has its own noise, the same reading written twice cancels
    assert told.u[0] > 1.1 * quiet.u[0]


def test_reference_and_calibration_cancel_where_they_are_shared():
    quiet = reduce_triplet(measurement())
    both = {f"placement__{k}__{key}": 2.31 for k in range(3) for key in ("phi_zrg_rad", "phi_zrg_flipped_rad")}
    told = reduce_triplet(measurement(**both))
    # all ranges grow alike: H_corr feels only that the prisms stand aside, 3e-4 of 0.16 mm
    np.testing.assert_allclose(told.h, quiet.h, atol=0.1e-6)
    assert told.lengths.d_1[0] - quiet.lengths.d_1[0] == pytest.approx(0.01 / (2 * np.pi) * 0.0999, rel=1e-3)


def test_the_claimed_uncertainty_against_the_formula_by_hand():
    """Shared reference: half a phase each of two prisms, one of the ball; heights, fixture, glass by their partials."""
    found = reduce_triplet(measurement())
    phase = 0.0008 / (2 * np.pi) * half_wavelengths(found.readings)[0][0] * np.sqrt(1.5)
    assert found.budget["phases"] == pytest.approx(phase / np.sqrt(3), rel=1e-3)
    assert found.budget["heights"] == pytest.approx(np.sqrt(2) * 5e-6, rel=1e-3)
    assert found.budget["l_post"] == pytest.approx(2 * 2e-6, rel=1e-3)
    size = np.sqrt(2) * 2e-6 * (N + 1 / N) / 2, 3e-6 * (N - 1), 3e-6 * N
    assert found.budget["glass sizes"] == pytest.approx(np.sqrt(np.sum(np.square(size))), rel=1e-3)
    ratio = (0.5 * (38.4 + 38.39) * (1 - N**-2) - 50.0126 - 96.4946) * 1e-3 * 1e-5
    assert found.budget["index ratio"] == pytest.approx(abs(ratio), rel=1e-3)
    assert found.budget["d_12"] == pytest.approx(0.635 * 30e-6 / (4 * 18.12), rel=1e-2)
    assert found.u_h_corr == pytest.approx(np.sqrt(sum(v**2 for v in found.budget.values())), rel=1e-12)
    plate = np.sqrt(1.5 * 5e-6**2 + 3e-6**2 + 2 * (2e-6 / (2 * N)) ** 2 + (0.5 * 76.79e-3 / N**2 * 1e-5) ** 2)
    assert found.u_l_mpbc == pytest.approx(plate, rel=1e-3)
    # what both share is taken off: the heights enter the difference with -1/2 and -1, not with -1 and -1/2 squared
    assert found.u_difference < np.hypot(found.u_h_corr, found.u_l_mpbc)


def test_common_inputs_do_not_average_out():
    one, three = reduced("TR03"), reduced("TR02")
    assert three.budget["heights"] == pytest.approx(one.budget["heights"], rel=1e-3)
    assert three.budget["phases"] == pytest.approx(one.budget["phases"] / 3.0, rel=1e-3)  # nine placements


def test_one_reading_of_the_prisms_for_several_flips_is_not_counted_twice():
    values = document()
    first = values["placement"][0]
    flips = [first | {"phi_bcfp_rad": first["phi_bcfp_rad"] + 1e-4 * k} for k in range(4)]
    found = reduce_triplet(TripletMeasurement.model_validate(values | {"placement": flips}))
    one = 0.0008 / (2 * np.pi) * half_wavelengths(found.readings)[0][0]
    assert found.budget["phases"] == pytest.approx(one * np.sqrt(0.5 + 1 / 4), rel=1e-3)


def test_the_index_of_the_glass_of_the_sheet_is_used():
    """The ball's glass outweighs the prisms' by 108 mm of path, which the air's index scales."""
    held = reduce_triplet(measurement())
    follows = reduce_triplet(measurement(bk7_group_index=N * 1.00025))
    eta = held.readings.eta_a
    extra = N * (1.00025 / eta - 1.0)
    lever = 1e-3 * (0.5 * (38.4 + 38.39) - 50.0126 - 96.4946)
    np.testing.assert_allclose(follows.h - held.h, lever * extra, rtol=1e-3)
    assert follows.air_in_glass == 0.0
    given_at_20 = reduce_triplet(measurement(bk7_group_index=N * 1.000253246815))
    assert given_at_20.h_corr - held.h_corr == pytest.approx(held.air_in_glass, rel=1e-3)


def test_the_ratio_that_joins_ranging_and_plate_does():
    found = reduced("TR05")
    values = tomllib.loads((EXAMPLES / "TR05.toml").read_text(encoding="utf-8"))
    n = found.agreeing_ratio
    values["bk7_to_air_group_index_ratio"] = n
    for side in ("left_prism", "right_prism"):
        height = values[side]["height_mm"]
        values[side] |= {"hrp_mm": height / n, "pc_mm": -(n - 1 / n) * height}
    r1, r2 = values["ball"]["r1_mm"], values["ball"]["r2_mm"]
    values["ball"]["pc_b_mm"] = r1 - n * (r1 + r2)
    again = reduce_triplet(TripletMeasurement.model_validate(values))
    assert abs(again.difference) < 1e-8


def test_paint_and_departures_by_hand():
    plate = reduce_triplet(measurement(surface_plate__top_surface_mm=[88.91, 88.93])).plate
    heights = (88.92, 88.885, 88.8795)  # L(T1), L(T2), L_BC of the example
    np.testing.assert_allclose(plate.height, np.array(heights) * 1e-3, atol=1e-12)
    low, high = plate.paint
    assert low == 0.0  # 88.9 - 88.8795 - 0.15 is below zero: paint is not
    assert high == pytest.approx((88.9 - 88.92 + 0.15) * 1e-3, abs=1e-12)
    assert plate.departure[0] == pytest.approx(((0.02 + 0.05) * 1e-3, (0.02 + 0.15) * 1e-3), abs=1e-12)
    assert plate.sampled == pytest.approx((0.01e-3, 0.02e-3, 0.03e-3), abs=1e-12)


def test_a_wrong_spacer_shows_in_the_place_of_the_stops():
    found = reduce_triplet(measurement(placement__1__spacer_mm=25.5))
    assert found.steps[1] == pytest.approx(0.1e-3, abs=1e-8)
    assert any("placement 2: by ranging the stops are +100.0 µm" in note for note in found.notes)
    assert not any("by ranging the stops" in note for note in reduce_triplet(measurement()).notes)


def test_a_coarse_distance_off_by_a_quarter_wavelength_is_noted():
    off = {f"placement__{k}__d_toppl_mm": d + 45.0 for k, d in enumerate((18150.0, 18124.6, 18099.2))}
    found = reduce_triplet(measurement(**off))
    assert found.status == ("thin margin",) * 3
    assert found.h_corr * 1e3 == pytest.approx(-0.023, abs=1e-5)
    far = {f"placement__{k}__d_toppl_mm": d + 99.9 for k, d in enumerate((18150.0, 18124.6, 18099.2))}
    # all whole cycles move alike, which no range can show; H_corr feels that the prisms stand aside, D12^2 / 8 D
    sag = 0.635**2 / 8 * (1 / 18.2245 - 1 / 18.1246)
    assert reduce_triplet(measurement(**far)).h_corr - found.h_corr == pytest.approx(sag, rel=0.01)


def test_ranges_that_make_no_triangle_leave_a_placement_out_with_its_status():
    """At 100 MHz a half wavelength is 1.5 m: the prisms' ranges can differ by more than the prisms are apart."""
    phases = {"phi_1_rad": 3.0, "phi_2_rad": 3.1, "phi_zrg_rad": 0.0, "phi_cal_rad": 0.0, "phi_bcfp_rad": 2.0}
    fair = document()["placement"][0] | phases
    fair = {key: value for key, value in fair.items() if "flipped" not in key}
    broken = fair | {"phi_2_rad": 5.9}
    values = document() | {"modulation_hz": 1e8}
    found = reduce_triplet(TripletMeasurement.model_validate(values | {"placement": [fair, broken]}))
    assert found.status[1] == "no triangle: left out"
    assert found.weights.tolist() == [1.0, 0.0]
    assert found.h_corr == found.h[0]
    none = reduce_triplet(TripletMeasurement.model_validate(values | {"placement": [broken]}))
    assert np.isnan(none.h_corr)
    assert not none.accepted
    assert plain(triplet_object(none, "a"))["h_corr"] is None
    assert "NOT ACCEPTED" in text_sheet(none, "a")
    assert svg_of(triplet_figure(none)).startswith("<?xml")


@given(difference=st.floats(-4e-4, 4e-4), u=st.floats(1e-6, 2e-4))
def test_conformity_is_the_normal_laws_share_within_the_limits(difference, u):
    expected = norm.cdf((TOLERANCE - difference) / u) - norm.cdf((-TOLERANCE - difference) / u)
    assert conformity_probability(difference, u) == pytest.approx(expected, abs=1e-12)


def test_accepted_is_the_limit_itself_and_not_the_probability():
    at_limit = conformity_probability(TOLERANCE, 1e-5)
    assert at_limit == pytest.approx(0.5, abs=1e-12)
    assert conformity_probability(TOLERANCE, 0.0) == 1.0
    assert conformity_probability(1.01 * TOLERANCE, 0.0) == 0.0
    assert np.isnan(conformity_probability(float("nan"), 1e-5))


@given(seed=st.integers(0, 10_000), count=st.integers(2, 6))
def test_values_are_combined_as_full_least_squares_does_it(seed, count):
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 1.0, (count, count)) + 2.0 * np.eye(count)
    covariance, values = root @ root.T, rng.normal(0.0, 3.0, count)
    best = combined(values, covariance, np.arange(count))
    white = np.linalg.solve(np.linalg.cholesky(covariance), np.stack([np.ones(count), values], axis=1))
    solution, square, *_ = np.linalg.lstsq(white[:, :1], white[:, 1], rcond=None)
    assert best.value == pytest.approx(solution[0], rel=1e-8, abs=1e-8)
    assert best.chi_square == pytest.approx(square[0], rel=1e-6, abs=1e-9)
    assert best.p == pytest.approx(chi2.sf(square[0], count - 1), rel=1e-6, abs=1e-12)
    # one value alone, allowed its own shift, takes w squared off chi-square
    more = np.linalg.solve(np.linalg.cholesky(covariance), np.stack([np.ones(count), np.eye(count)[0]], axis=1))
    rest = np.linalg.lstsq(more, white[:, 1], rcond=None)[0]
    gained = square[0] - np.sum((white[:, 1] - more @ rest) ** 2)
    assert best.statistics[0] ** 2 == pytest.approx(gained, rel=1e-5, abs=1e-8)


def test_two_values_that_contradict_each_other_are_both_named():
    best = combined(np.array([0.0, 10.0]), np.eye(2), np.arange(2))
    assert best.suspects == (0, 1)
    assert combined(np.array([0.0, 1.0]), np.eye(2), np.arange(2)).suspects == ()
    assert np.isnan(combined(np.array([np.nan]), np.eye(1), np.arange(0)).value)


def test_readings_are_in_metres_and_every_placement_has_its_own_air():
    readings = triplet_readings(measurement(placement__1__temperature_c=0.0))
    assert readings.d_toppl.tolist() == pytest.approx([18.15, 18.1246, 18.0992])
    assert readings.eta_a[1] > readings.eta_a[0] + 1.5e-5  # 20 deg C colder, some 0.9e-6 each
    assert readings.eta_a_fp[1] < readings.eta_a[1]


def test_a_random_unit_is_reduced_as_its_truth_within_its_uncertainty():
    sheet, truth = noisy_unit(np.random.default_rng(3))
    found = reduce_triplet(sheet)
    assert abs(found.h_corr - truth) < 4.0 * found.u_h_corr


def test_a_repeated_placement_is_noted_and_keeps_valid_weights():
    """Nothing but the phases differs between placements here, and they are the same."""
    own = document()["placement"][0]
    quiet = {f"u_{key}": 0.0 for key in ("temperature_c", "pressure_hpa", "humidity_percent")}
    found = reduce_triplet(measurement(placement=[own, own], **quiet))
    np.testing.assert_allclose(found.weights, 0.5)
    assert found.h_corr == pytest.approx(-23e-6, abs=2e-9)
    assert any("placement 2 repeats the phases of placement 1" in note for note in found.notes)
    assert not any("repeats" in note for note in reduce_triplet(measurement()).notes)


def test_equal_digits_are_no_proof_of_one_reading_where_they_are_few():
    """In steps of 1 mrad with 0.8 mrad of noise a second reading of the reference is often the same."""
    names = ("phi_1_rad", "phi_2_rad", "phi_bcfp_rad")
    few = document()["placement"]
    for each in few:
        each.update({name: round(each[name], 3) for name in names})
    fine, coarse = reduced("TR99"), reduce_triplet(measurement(placement=few))
    # a half each of two prisms and the ball, one reference for the prisms in all, one for the ball in each flip
    one = 0.0008 / (2 * np.pi) * half_wavelengths(fine.readings)[0][0]
    assert fine.budget["phases"] == pytest.approx(one * np.sqrt(1.5 / 3), rel=1e-3)
    assert coarse.budget["phases"] > one * np.sqrt(3.5 / 3)
    once = [{k: v for k, v in each.items() if k != "phi_zrg_flipped_rad"} for each in few]
    assert reduce_triplet(measurement(placement=once)).budget["phases"] == pytest.approx(
        fine.budget["phases"], rel=1e-3
    )


def test_omissions_of_the_memos_index_are_noted():
    (note,) = [note for note in reduced("TR99").notes if "as against vacuum" in note]
    # 4.30e-4 of the ratio times 124.6 and 108.1 mm
    assert "1.52750" in note
    assert "H_corr would be -54 µm and the difference -47 µm more" in note
    told = reduce_triplet(measurement(bk7_group_index=1.527892)).notes
    assert not any("as against vacuum" in note for note in told)


def test_no_index_of_glass_is_offered_for_a_whole_cycle():
    text = " ".join(reduce_triplet(measurement(placement=document()["placement"][:1], d12_mm=500.0)).notes)
    assert "ranging and surface plate differ by" in text
    assert "would reconcile them" not in text
    near = reduce_triplet(measurement(ball__r1_mm=50.0626, ball__pc_b_mm=-173.741529))  # 50 um: 7e-4 of the ratio
    assert any("would reconcile them" in note for note in near.notes)


def test_a_barometer_in_millimetres_of_mercury_is_suspected():
    low = measurement(placement__1__pressure_hpa=698.3, placement__1__pressure_flipped_hpa=698.3)
    assert [note for note in reduce_triplet(low).notes if "931.0 hPa is meant" in note] != []
    assert not any("mercury" in note for note in reduced("TR99").notes)


def test_the_memos_integers_182_182_184():
    """Section 3.4: all three by INT of a D_TOPPL between 18.209 and 18.249 m; phases above the reference add one."""
    pc, pc_b, half = 33.493677, 173.715175, 99.905619
    assert [int((18230.0 + each) / half) for each in (pc, pc_b)] == [182, 184]
    phases = dict.fromkeys(("phi_zrg_rad", "phi_zrg_flipped_rad", "phi_cal_rad"), 3.0)
    phases |= dict.fromkeys(("phi_1_rad", "phi_2_rad", "phi_bcfp_rad"), 1.0)
    own = document()["placement"][0] | {"d_toppl_mm": 18230.0} | phases
    memo = reduce_triplet(measurement(placement=[own])).memo
    assert [int(n[0]) for n in (memo.n_1, memo.n_2, memo.n_bc)] == [182, 182, 184]
