"""What a program is told of the air beside the weather stations."""

import numpy as np
import pytest

from catseye.gateways.epoch.objects import benchmark_object
from catseye.reduction.air.group_index import BenchmarkSeries


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
