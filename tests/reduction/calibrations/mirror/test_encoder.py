"""Encoder waves: from their definition, with a polygon's errors, orders that cannot be told, refusals."""

import numpy as np
import pytest

from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.mirror.encoder import RECIPE
from lab_scene import ARC, PER_RADIAN, polygon, table, waves

TRUTH = {"zero": 2691.0, "cosine": (3.0, -1.0), "sine": (-2.0, 0.5)}
SHEET = {"axis": "azimuth", "zero_counts": 2691.0, "u_face_arcsec": 1.0, "u_counts": 0.02, "u_reading_arcsec": 0.1}


def calibrated(numbers, words=None, reject=False, **sheet):
    return RECIPE.recipe(table(RECIPE, numbers, words, **{**SHEET, **sheet}), reject)


def test_a_polygon_gives_back_the_waves_in_the_records_keys():
    found = calibrated(*polygon(TRUTH))
    np.testing.assert_allclose(found.record["azimuth_encoder_cosine_counts"], TRUTH["cosine"], atol=1e-6)
    np.testing.assert_allclose(found.record["azimuth_encoder_sine_counts"], TRUTH["sine"], atol=1e-6)
    assert found.record["u_encoder_counts"] == max(q.u for q in found.quantities)


def test_the_pointing_reads_the_record_as_the_encoders_error():
    from catseye.geometry.mirror.imperfect import Imperfections, imperfect_ray
    from catseye.geometry.mirror.pointing import MirrorStation, ray

    found = calibrated(*polygon(TRUTH)).record
    psi = 1.1
    station = MirrorStation(np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2), np.array([2691.0, 1434.0]))
    read = 2691.0 + PER_RADIAN * psi + waves(psi, TRUTH["cosine"], TRUTH["sine"])
    both = np.array([found["azimuth_encoder_cosine_counts"], found["azimuth_encoder_sine_counts"]])
    real = imperfect_ray(station, Imperfections(np.zeros(4), np.zeros(3), both, np.zeros((2, 0))), [read, 9000.0])
    ideal = ray(station, [2691.0 + PER_RADIAN * psi, 9000.0])
    np.testing.assert_allclose(real.direction, ideal.direction, atol=1e-9)


def test_targets_of_the_elevation_count_by_half_the_beam():
    psi = np.radians(np.linspace(-70, 70, 15))
    n = 1434.0 + PER_RADIAN * psi + waves(psi, (0.8,), (-1.2,))
    found = calibrated(
        {"angle_deg": np.degrees(2 * psi), "counts": n}, axis="elevation", angle_is="beam", zero_counts=1434.0, orders=1
    )
    assert found.record["elevation_encoder_cosine_counts"][0] == pytest.approx(0.8, abs=1e-5)
    assert found.record["elevation_encoder_sine_counts"][0] == pytest.approx(-1.2, abs=1e-5)


@pytest.mark.parametrize(("display", "factor"), [("mirror", 1.0), ("beam", 2.0)])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_autocollimators_reading_is_added_with_sign_and_factor(display, factor, sign):
    numbers, words = polygon(TRUTH)
    off = np.linspace(-40, 40, len(numbers["counts"]))
    psi = (
        np.array(numbers["angle_deg"]) * np.pi / 180 + np.where(np.array(words["run"]) == "r0", 0.4, 1.1)
    ) + off * ARC
    numbers["counts"] = 2691.0 + PER_RADIAN * psi + waves(psi, TRUTH["cosine"], TRUTH["sine"])
    numbers["reading_arcsec"] = sign * factor * off
    found = calibrated(numbers, words, displays=display, reading_sign=sign)
    np.testing.assert_allclose([q.value for q in found.quantities], [3.0, -1.0, -2.0, 0.5], atol=1e-6)


@pytest.mark.parametrize("cut", [90.0, 180.0, 330.0])
def test_angles_that_begin_again_at_a_whole_turn_are_the_same_table(cut):
    numbers, words = polygon(TRUTH, np.random.default_rng(3))
    plain = calibrated(numbers, words)
    again = calibrated(
        {**numbers, "angle_deg": [a - 360.0 * (a >= cut) for a in numbers["angle_deg"]]}, words, u_reading_arcsec=None
    )
    np.testing.assert_allclose([q.value for q in again.quantities], [q.value for q in plain.quantities], atol=0.01)


def test_counts_that_do_not_go_with_the_angles_are_refused():
    numbers, words = polygon(TRUTH)
    with pytest.raises(InputError, match=r"counts = .* lie [-+]\d+ from where the run's angles have them"):
        calibrated({**numbers, "angle_deg": [-a for a in numbers["angle_deg"]]}, words)
    psi = np.radians(np.linspace(-70, 70, 15))
    beam = {"angle_deg": np.degrees(2 * psi), "counts": 1434.0 + PER_RADIAN * psi}
    with pytest.raises(InputError, match="is angle_is right"):
        calibrated(beam, axis="elevation", angle_is="axis", zero_counts=1434.0)


def test_few_readings_seldom_give_false_encoder_waves():
    flagged, tables = 0, 200
    for seed in range(tables):
        psi = np.radians(np.arange(0, 360, 60.0))
        n = 2691.0 + PER_RADIAN * psi + 0.1 * np.random.default_rng([8, seed]).standard_normal(6)
        found = calibrated({"angle_deg": np.degrees(psi), "counts": n}, orders=1, u_counts=0.0, u_reading_arcsec=None)
        flagged += found.decisions[0].statistic > found.decisions[0].limit
    assert flagged <= 22  # 5 % of 200 are 10; more than 22 is a chance of 1e-4


def test_a_second_run_from_another_face_separates_polygon_and_encoder():
    one, two = (calibrated(*polygon(TRUTH, starts=starts), u_face_arcsec=20.0) for starts in ((0,), (0, 3, 6, 9)))
    assert one.u("azimuth_encoder_cosine_1_counts") > 4 * two.u("azimuth_encoder_cosine_1_counts")


def test_orders_that_a_polygon_cannot_determine_are_refused_by_name():
    psi = np.radians(np.arange(0, 360, 90.0))
    with pytest.raises(EstimationError, match=r"rank deficient: .*2"):
        calibrated({"angle_deg": np.degrees(psi), "counts": 2691.0 + PER_RADIAN * psi})


def test_each_order_is_judged():
    rng = np.random.default_rng(1)
    found = calibrated(*polygon({**TRUTH, "cosine": (3.0, 0.0), "sine": (0.0, 0.0)}, rng, size=0.02))
    first, second = found.decisions[:2]
    assert first.statistic > first.limit > second.statistic


def test_a_wrong_reading_is_rejected_on_request_and_the_sheet_checked():
    numbers, words = polygon(TRUTH, np.random.default_rng(2))
    numbers["counts"][7] += 1.0
    found = calibrated(numbers, words, True)
    assert [k for k, s in enumerate(found.states) if s == "rejected"] == [7]
    with pytest.raises(InputError, match="u_face_arcsec is missing"):
        calibrated(numbers, words, u_face_arcsec=None)
    with pytest.raises(InputError, match="angle_is = 'beam' belongs to axis = 'elevation'"):
        calibrated(numbers, words, angle_is="beam")
