"""Tests of records, contradictions and checks, made by hand for a reduction: every kind of each."""

from dataclasses import replace

import numpy as np

from catseye.reduction.epoch.contradictions.contradiction import (
    ClassScatter,
    Contradiction,
    GroupTest,
    RecordError,
    RecordGroup,
    RecordTest,
)

UNITS = {
    RecordGroup.MODULATION: "ppm",
    RecordGroup.PRESSURE: "hPa",
    RecordGroup.HUMIDITY: "%",
    RecordGroup.THERMOMETERS: "°C",
    RecordGroup.POSTURE: "″",
}
OWNERS = {
    RecordGroup.MONUMENTS: ("monument ZY103", "monuments/ZY103.toml", ("east", "north", "up")),
    RecordGroup.OFFSETS: ("mirror ZP101", "mirrors/ZP101.toml", ("dx", "dy", "dz")),
    RecordGroup.BENCHMARKS: ("benchmark ZBM01", "benchmarks.csv", ("",)),
    RecordGroup.TRIPLETS: ("triplet TR01", "triplets/TR01.toml", ("",)),
    RecordGroup.GLASS: ("glass DP001", "site.toml", ("",)),
    RecordGroup.POSITIONS: ("target ZEG41040L", "targets.toml", ("east", "north", "up")),
    RecordGroup.POSTURE: ("posture", "site.toml", ("azimuth", "elevation")),
    RecordGroup.MODULATION: ("modulation frequency", "site.toml", ("",)),
    RecordGroup.PRESSURE: ("barometer WX1", "weather.csv", ("",)),
    RecordGroup.HUMIDITY: ("hygrometer WX1", "weather.csv", ("",)),
    RecordGroup.THERMOMETERS: ("thermometer WX1", "weather.csv", ("",)),
    RecordGroup.ZEROS: ("zero ZY101", "mirrors/ZP101.toml", ("",)),
    RecordGroup.HEADS: ("axes ZY101", "mirrors/ZP101.toml", ("tilt",)),
}


def record_tests(many=1, seed=45):
    """Tests of all groups; the last number of each is not tested, and w of a certificate is 92."""
    rng = np.random.default_rng(seed)
    tests = []
    for group, (record, file, parts) in OWNERS.items():
        for k in range(many):
            for part in parts:
                u = 10.0 ** rng.uniform(-2.0, 0.0)
                u_error = u * rng.uniform(1.0, 3.0)
                named = record if k == 0 else f"{record}/{k}"
                where = f"{file}: {part or 'value'}"
                unit = UNITS.get(group, "mm")
                tests.append(RecordTest(group, named, where, part, unit, u, u_error * rng.normal(), u_error))
        tests.append(RecordTest(group, f"{record}/x", file, "", UNITS.get(group, "mm"), 1.0, np.nan, np.inf))
    certificate = next(k for k, test in enumerate(tests) if test.group == RecordGroup.BENCHMARKS)
    tests[certificate] = replace(tests[certificate], u=0.05, error=0.92, u_error=0.01)
    unstated = next(k for k, test in enumerate(tests) if test.group == RecordGroup.MODULATION)
    tests[unstated] = replace(tests[unstated], u=0.0)  # a frequency is recorded without an uncertainty
    return tuple(tests)


def contradictions():
    """A monument by itself, and a certificate or a zero."""
    monument = RecordError(
        RecordGroup.MONUMENTS, "monument ZY103", "monuments/ZY103.toml: x_mm, y_mm, z_mm", ("east", "north", "up"),
        "mm", (1.0, -0.12, 0.003), (0.05, 0.06, 0.04), 400.0,
    )  # fmt: skip
    certificate = RecordError(
        RecordGroup.BENCHMARKS, "benchmark ZBM01", "benchmarks.csv: certified_distance_mm", ("",), "mm", (0.92,),
        (0.01,), 81.5,
    )  # fmt: skip
    zero = RecordError(
        RecordGroup.ZEROS, "zero ZY101", "mirrors/ZP101.toml: d0_mm", ("",), "mm", (-0.9,), (0.011,), 80.2
    )
    return (Contradiction((monument,)), Contradiction((certificate, zero)))


def with_checks(reduction, many=1):
    """The reduction with tests of records, two contradictions, unchecked points and an unmeasured target."""
    coordinates = reduction.coordinates
    unchecked = ("DP003", "ZEG41040L")
    return replace(
        reduction,
        coordinates=replace(
            coordinates,
            records=record_tests(many),
            groups=(
                GroupTest(RecordGroup.MONUMENTS, 421.5, 36, 3e-67),
                GroupTest(RecordGroup.ZEROS, 17.25, 18, 0.5062),
            ),
            contradictions=contradictions(),
            scatter=(ClassScatter("dish", 0.98, 400), ClassScatter("feed arm", 1.02, 91, 0.00031)),
            unchecked=unchecked,
            unmeasured=("ZEG41099L",),
        ),
    )
