"""Objects for programs: air beside the weather stations, and tests of records."""

import json
from dataclasses import replace

import numpy as np
import pytest

from catseye.gateways.epoch.objects import benchmark_object, reduction_object
from catseye.gateways.epoch.record_tests import listed_tests, record_objects
from catseye.gateways.writers.objects import json_page
from catseye.reduction.air.group_index import BenchmarkSeries
from catseye.reduction.site.plausible.record import ImplausibleRecord
from gateways.record_scene import with_checks


def test_each_number_of_a_benchmark_is_its_own_mean_over_the_used_shots():
    """Every field unlike the others; the third shot was not used."""
    used = np.array([True, True, False])
    fields = {"path": 270e-6, "u_path": 0.2e-6, "weather": 271e-6, "u_weather": 0.6e-6, "adjusted": 270.5e-6}
    series = BenchmarkSeries(
        benchmark="ZBM01",
        ranger="ZY101",
        mjd_utc=np.arange(3.0),
        used=used,
        u_common=0.1e-6,
        too_warm_c=-0.4,
        u_too_warm_c=0.3,
        **{name: value * np.array([0.9, 1.1, 7.0]) for name, value in fields.items()},
    )
    told = benchmark_object(series)
    assert told == pytest.approx(
        {
            "benchmark": "ZBM01",
            "ranger": "ZY101",
            "shots": 2,
            "path_ppm": 270.0,
            "u_path_ppm": 0.2,
            "weather_ppm": 271.0,
            "u_weather_ppm": 0.6,
            "adjusted_ppm": 270.5,
            "thermometers_too_warm_c": -0.4,
            "u_thermometers_too_warm_c": 0.3,
        }
    )


def test_records_and_contradictions_have_their_numbers_and_units(reduction):
    coordinates = with_checks(reduction).coordinates
    told = record_objects(coordinates)
    for test, entry in zip(listed_tests(coordinates), told["records"], strict=True):
        assert (entry["group"], entry["record"], entry["part"]) == (str(test.group), test.record, test.part)
        assert (entry["unit"], entry["where"]) == (test.unit, test.where)
        np.testing.assert_equal(entry["u_record"], test.u or np.nan)
        if np.isfinite(test.u_error):
            assert entry["error"] / entry["u_error"] == pytest.approx(entry["w"])
    one, two = told["contradictions"]
    assert one["text"].startswith("the ranges contradict monument ZY103")
    (monument,) = one["explanations"]
    assert dict(zip(monument["parts"], monument["errors"], strict=True)) == {"east": 1.0, "north": -0.12, "up": 0.003}
    assert [entry["record"] for entry in two["explanations"]] == ["benchmark ZBM01", "zero ZY101"]
    assert told["groups"][0] == {
        "group": "monuments", "chi_squared": 421.5, "degrees_of_freedom": 36, "probability": 3e-67,
    }  # fmt: skip
    assert told["scatter"][1] == {"class": "feed arm", "variance_factor": 1.02, "shots": 91, "sway": 0.00031}
    assert (told["unchecked"], told["unmeasured"]) == (["DP003", "ZEG41040L"], ["ZEG41099L"])


def test_what_nothing_tests_is_null_and_each_record_has_a_line(reduction):
    page = json_page(reduction_object(with_checks(reduction)))
    told = json.loads(page, parse_constant=pytest.fail)
    untested = [entry for entry in told["records"] if entry["w"] is None]
    assert len(untested) == 13
    assert all(entry["error"] is entry["u_error"] is None for entry in untested)
    assert sum(line.startswith('    {"group": "benchmarks", "record": ') for line in page.splitlines()) == 2


def test_an_implausible_record_is_told_with_its_owners(reduction):
    record = ImplausibleRecord("weather.csv: humidity_pct", "WX1 reads 0 % throughout", "humidity", ("WX1",))
    (told,) = reduction_object(replace(reduction, implausible=(record,)))["implausible"]
    assert told == {
        "text": record.text, "where": record.where, "quantity": "humidity", "owners": ["WX1"],
    }  # fmt: skip


def test_each_point_has_its_lines_and_all_keys_stand_without_any_test(reduction):
    coordinates = reduction.coordinates
    bare = replace(coordinates, records=(), groups=(), contradictions=(), scatter=(), unchecked=(), unmeasured=())
    told = reduction_object(replace(reduction, coordinates=bare))
    at = coordinates.points.index("DP003")
    assert told["points"]["DP003"]["lines"] == coordinates.lines[at] > 0
    for key in ("records", "groups", "contradictions", "scatter", "unchecked", "unmeasured"):
        assert told[key] == []
