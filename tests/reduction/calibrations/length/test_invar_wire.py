"""The Invar wire: textbook corrections by hand, the wire from a known distance, scatter."""

import numpy as np
import pytest

from catseye.reduction.calibrations.length.invar_wire import KIND, WireSheet, measure_with_wire
from draws import draws, same_sigmas
from reduction.calibrations.length_scene import readings

WIRE = {
    "certified_mm": 24_000.0,
    "u_certified_mm": 0.02,
    "certified_tension_n": 100.0,
    "hanging": True,
    "weight_n_per_m": 0.17,
    "u_weight_n_per_m": 1e-4,
    "stiffness_n": 4.1e5,
    "u_stiffness_n": 5e3,
    "expansion_ppm_per_c": 0.6,
    "u_expansion_ppm_per_c": 0.1,
    "u_tension_n": 0.1,
    "u_temperature_c": 0.5,
    "height_difference_mm": 0.0,
    "u_height_difference_mm": 1.0,
    "u_scale_sum_mm": 0.01,
    "scale_sum_mm": 0.0,
}


def hung(**changes):
    numbers = {name: changes.pop(name) for name in list(changes) if np.ndim(changes[name])}
    sheet = {**{k: v for k, v in WIRE.items() if k not in numbers}, **changes}
    return measure_with_wire(readings(WireSheet, KIND, numbers=numbers, **sheet))


def test_hung_as_certified_it_shows_its_certified_length_and_the_scales():
    found = hung(tension_n=[100.0] * 3, temperature_c=20.0, scale_sum_mm=3.25, u_reading_mm=0.02)
    assert found.value("distance_mm") == pytest.approx(24_003.25, abs=1e-8)


def test_the_u_of_the_known_distance_is_that_of_the_wire():
    exact = {key: 0.0 for key in WIRE if key.startswith("u_")}
    found = hung(
        **exact, tension_n=[100.0], temperature_c=20.0, u_reading_mm=1e-6, known_distance_mm=24_000.1,
        u_known_distance_mm=0.03,
    )  # fmt: skip
    assert found.value("certified_mm") == pytest.approx(24_000.1, abs=1e-6)
    assert found.u("certified_mm") == pytest.approx(0.03, rel=1e-3)  # not that of the certificate it replaces


def test_tension_temperature_and_slope_correct_by_the_surveyors_formulas():
    found = hung(tension_n=[120.0] * 2, temperature_c=30.0, height_difference_mm=1200.0, u_reading_mm=0.02)
    length = 24_000.0
    stretch = 20.0 * length / 4.1e5
    sag = length * (0.17 * 24.0) ** 2 / 24.0 * (1 / 100.0**2 - np.cos(1.2 / 24.0) ** 2 / 120.0**2)
    warm = 0.6e-6 * 10.0 * length
    assert found.value("distance_mm") == pytest.approx(length + stretch + sag + warm, abs=0.02)  # of 5.1 mm
    by_tension = found.u("distance_mm")
    assert by_tension > 0.1 * 24_000.0 / 4.1e5  # what 0.1 N alone do


def test_a_known_distance_gives_back_the_wire():
    distance = hung(tension_n=[110.0, 100.0], temperature_c=[22.0, 26.0], u_reading_mm=0.02)
    columns = [float(v) for v in (row[distance.columns.index("distance_mm")] for row in distance.rows)]
    scale = np.array(columns)
    found = hung(
        tension_n=[110.0, 100.0],
        temperature_c=[22.0, 26.0],
        scale_sum_mm=24_000.3 - scale,
        known_distance_mm=24_000.3 + 0.15,
        u_known_distance_mm=0.01,
        u_reading_mm=0.02,
    )
    assert found.value("certified_mm") == pytest.approx(24_000.15, abs=1e-5)


@draws(150)
def test_the_claimed_uncertainty_matches_the_scatter_of_all_inputs(runs):
    rng = np.random.default_rng(3)
    found, u = [], []
    for _ in range(runs):
        tension, warm = 100.0 + 0.1 * rng.normal(), 27.0 + 0.5 * rng.normal()
        made = hung(
            tension_n=[tension] * 4,
            temperature_c=warm,
            certified_mm=24_000.0 + 0.02 * rng.normal(),
            weight_n_per_m=0.17 + 1e-4 * rng.normal(),
            stiffness_n=4.1e5 + 5e3 * rng.normal(),
            expansion_ppm_per_c=0.6 + 0.1 * rng.normal(),
            height_difference_mm=800.0 + 1.0 * rng.normal(),
            scale_sum_mm=(0.01 * rng.normal() + 0.03 * rng.normal(size=4)).tolist(),
            u_reading_mm=0.03,
        )
        found.append(made.value("distance_mm"))
        u.append(made.u("distance_mm"))
    assert np.std(found) == pytest.approx(np.mean(u), rel=same_sigmas(0.19, 150, runs))  # 150 runs: 6 %
    nominal = hung(tension_n=[100.0] * 4, temperature_c=27.0, height_difference_mm=800.0, u_reading_mm=0.03)
    assert np.mean(found) == pytest.approx(nominal.value("distance_mm"), abs=4 * np.mean(u) / np.sqrt(runs))
