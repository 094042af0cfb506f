"""Search results: counts by the notes' own program, priors, what no counts tell apart, laboratory against field."""

import numpy as np
import pytest

from catseye.errors import EstimationError, InputError
from catseye.gateways.calibrations.certificate_record import calibration_toml
from catseye.records.laboratory.calibration import CalibrationRecord
from catseye.reduction.calibrations.mirror.search_results import RECIPE
from lab_scene import MIRROR, MONUMENT, field, searches, station_truth, table

NAMES = ("x", "y", "z", "alpha1", "alpha2", "alpha3", "dx", "dy", "dz", "beta1", "beta2", "na0", "ne0")


def calibrated(parameters, rng=None, reject=False, made=None, monument=MONUMENT, mirror=MIRROR, **sheet):
    numbers, words = searches(parameters, rng, **(made or {}))
    sheet = {"u_counts": 0.5, "u_target_mm": 0.0, **sheet}
    return RECIPE.recipe(table(RECIPE, numbers, words, monument=monument, mirror=mirror, **sheet), reject)


def test_counts_predicted_by_the_records_change_nothing():
    truth, u = station_truth()
    found = calibrated(truth)
    np.testing.assert_allclose([found.value("na0"), found.value("ne0")], [2691.0, 1434.0], atol=1e-6)
    assert found.decisions[0].passed is True
    assert found.decisions[0].statistic == pytest.approx(0.0, abs=1e-6)
    assert found.u("alpha1_rad") < 0.8 * u[3]


@pytest.mark.parametrize(("name", "by"), [("na0", 2.0), ("ne0", -2.0), ("alpha3", 3e-5), ("alpha1", -5e-5)])
def test_a_detectable_change_is_found_with_its_sign(name, by):
    truth, _ = station_truth()
    k = NAMES.index(name)
    truth[k] += by
    # all others are held tightly, so that only this one can follow
    monument = {**MONUMENT, **{f"u_alpha{i}_rad": 1e-9 for i in (1, 2, 3)}}
    mirror = {**MIRROR, "u_beta_rad": 1e-9, "u_zero_counts": 1e-3}
    if "alpha" in name:
        monument[f"u_{name}_rad"] = 1e-3
    else:
        mirror["u_zero_counts"] = 100.0
    found = calibrated(truth, monument=monument, mirror=mirror, u_counts=0.05)
    key = f"{name}_rad" if "alpha" in name else name
    start = station_truth()[0][k]
    assert (found.value(key) - start) == pytest.approx(by, rel=0.02)


def test_seven_combinations_are_all_that_counts_can_hold():
    # a place and three turns of the whole mirror, and the elevation encoder's zero: na0 is one of the turns
    found = calibrated(station_truth()[0])
    assert found.notes[1].startswith("without the laboratory they would hold 7 of 13")
    for name in ("alpha1", "beta1", "na0", "dx"):
        assert name in found.notes[1].partition(": ")[2]
    assert "ne0" not in found.notes[1].partition(": ")[2]


def test_a_laboratory_that_is_wrong_is_contradicted_by_name():
    truth, u = station_truth()
    truth[12] += 12.0 * u[12]
    found = calibrated(truth, np.random.default_rng(2))
    assert found.decisions[0].passed is False
    failed = [d.name for d in found.decisions if d.passed is False and "change over" in d.name]
    assert failed == ["ne0: change over its u"]
    assert found.record["mirror"]["ne0"] == pytest.approx(truth[12], abs=1.0)
    assert found.record["mirror"]["u_zero_counts"] < u[12]


def test_prime_pointings_and_whole_turns_serve_as_well():
    truth, _ = station_truth()
    truth[11] += 1.0
    numbers, words = searches(truth, prime=(0, 3, 4))
    numbers["azimuth_counts"][0] -= 100_000.0
    readings = table(
        RECIPE,
        numbers,
        words,
        u_counts=0.1,
        u_target_mm=0.0,
        monument=MONUMENT,
        mirror={**MIRROR, "u_zero_counts": 50.0},
    )
    found = RECIPE.recipe(readings, False)
    assert max(abs(row[5]) for row in found.rows) < 1e-2
    assert found.decisions[0].passed is True


def test_the_covariance_of_a_linear_adjustment_by_hand():
    from catseye.geometry.mirror.pointing import MirrorStation, counts_jacobian

    truth, u = station_truth()
    found = calibrated(truth, u_counts=0.5, u_target_mm=3.0)
    by_point, by_station = counts_jacobian(MirrorStation.of_parameters(truth), field())
    normal = np.diag(u**-2.0)
    for point, station in zip(by_point, by_station, strict=True):
        normal += station.T @ np.linalg.inv(0.25 * np.eye(2) + 9e-6 * point @ point.T) @ station
    expected = np.sqrt(np.diag(np.linalg.inv(normal)))
    size = [1e-3] * 3 + [1.0] * 3 + [1e-3] * 3 + [1.0] * 4
    np.testing.assert_allclose([q.u for q in found.quantities], expected / size, rtol=1e-5)


def test_a_target_seen_twice_keeps_its_error():
    truth, _ = station_truth()
    places = np.repeat(field(count=6), 4, axis=0)
    numbers, words = searches(truth, targets=places)
    sheet = {"u_counts": 0.1, "u_target_mm": 20.0, "monument": MONUMENT, "mirror": {**MIRROR, "u_zero_counts": 50.0}}
    apart = RECIPE.recipe(table(RECIPE, numbers, words, **sheet), False)
    words["target"] = [f"T{k // 4}" for k in range(24)]
    same = RECIPE.recipe(table(RECIPE, numbers, words, **sheet), False)
    assert same.u("ne0") > 1.5 * apart.u("ne0")


def test_a_wrong_target_is_rejected_on_request_and_the_page_reads_back():
    import tomllib

    numbers, words = searches(station_truth()[0], np.random.default_rng(7))
    numbers["elevation_counts"][5] += 15.0
    sheet = {"u_counts": 0.5, "u_target_mm": 1.0, "monument": MONUMENT, "mirror": MIRROR}
    found = RECIPE.recipe(table(RECIPE, numbers, words, **sheet), True)
    assert [k for k, s in enumerate(found.states) if s == "rejected"] == [5]
    record = CalibrationRecord.model_validate(tomllib.loads(calibration_toml(found)))
    assert record.record["monument"]["alpha1_rad"] == found.value("alpha1_rad")
    assert record.record["monument"]["azimuth_deg"] == pytest.approx(248.599755, abs=0.01)
    assert record.sheet["mirror"]["zp"] == "ZP103"


def test_records_without_weights_and_counts_of_elsewhere_are_refused():
    truth, _ = station_truth()
    with pytest.raises(InputError, match=r"t\.toml: mirror\.u_beta_rad is missing"):
        calibrated(truth, mirror={k: v for k, v in MIRROR.items() if k != "u_beta_rad"})
    numbers, words = searches(truth)
    numbers["azimuth_counts"][3] += 40_000.0
    sheet = {"u_counts": 0.5, "u_target_mm": 0.0, "monument": MONUMENT, "mirror": MIRROR}
    with pytest.raises(InputError, match=r"line 5, azimuth_counts, elevation_counts lie \+40000, \+0 from where"):
        RECIPE.recipe(table(RECIPE, numbers, words, **sheet), False)
    with pytest.raises(EstimationError, match="decide nothing"):
        calibrated(truth, u_counts=1000.0)
