"""Constants of glass: the memo's printed numbers, and scatter of whole calibrations."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.calibrations.ranging.glass_constants import (
    BALL,
    PRISM,
    GlassSheet,
    calibrate_ball,
    calibrate_prism,
)
from draws import draws, same_sigmas
from reduction.calibrations.length_scene import readings

GLASS = {
    "index_ratio": 1.527077,
    "u_index_ratio": 1e-5,
    "expansion_ppm_per_c": 7.1,
    "temperature_c": 23.0,
    "u_temperature_c": 0.2,
    "u_gauge_mm": 0.0003,
}


def test_the_memos_prism_and_ball_have_its_constants():
    cold = {**GLASS, "temperature_c": 20.0}
    prism = calibrate_prism(readings(GlassSheet, PRISM, numbers={"height_mm": [38.4, 38.4001, 38.3999]}, **cold))
    assert prism.value("pc_mm") == pytest.approx(-33.4937, abs=5e-5)
    assert prism.value("hrp_mm") == pytest.approx(38.4 / 1.527077, abs=1e-6)
    r1, r2 = 1.969 * 25.4, 3.799 * 25.4
    ball = calibrate_ball(
        readings(
            GlassSheet,
            BALL,
            numbers={"radius_mm": [r1, r2, r1 + 1e-4, r2 + 1e-4]},
            words={"part": ("r1", "r2", "r1", "r2")},
            **cold,
        )
    )
    assert ball.value("pc_b_mm") == pytest.approx(-173.715, abs=5e-4)
    assert ball.record["u_r_mm"] == pytest.approx(max(ball.u("r1_mm"), ball.u("r2_mm")))


def test_warm_glass_is_taken_to_20_degrees():
    warm = calibrate_prism(readings(GlassSheet, PRISM, numbers={"height_mm": [38.4] * 3}, u_reading_mm=0.001, **GLASS))
    assert warm.value("height_mm") == pytest.approx(38.4 * (1 - 7.1e-6 * 3.0), abs=1e-7)


@draws(400)
def test_the_claimed_covariance_of_a_balls_constants_is_their_scatter(runs):
    rng = np.random.default_rng(4)
    part = ("r1", "r2") * 4
    truth = np.array([50.0, 96.5])
    found, claimed = [], []
    for _ in range(runs):
        index = 1.527077 + 1e-4 * rng.normal()
        gauge, warm = 0.002 * rng.normal(), 0.5 * rng.normal()
        size = truth[[0, 1] * 4] * (1 + 7.1e-6 * (3.0 + warm)) + gauge + 0.003 * rng.normal(size=8)
        sheet = {**GLASS, "u_index_ratio": 1e-4, "u_gauge_mm": 0.002, "u_temperature_c": 0.5, "u_reading_mm": 0.003}
        made = readings(GlassSheet, BALL, numbers={"radius_mm": size}, words={"part": part}, **sheet)
        c = calibrate_ball(made)
        true = -(index * truth.sum() - truth[0])
        found.append([c.value("r1_mm") - 50.0, c.value("r2_mm") - 96.5, c.value("pc_b_mm") - true])
        claimed.append(c.covariance)
    scatter, claim = np.cov(np.array(found).T), np.mean(claimed, axis=0)
    u = np.sqrt(np.diag(claim))
    assert np.all(np.abs(scatter - claim) / np.outer(u, u) < same_sigmas(0.25, 400, runs))  # 400 runs: 7 to 10 % each


def test_a_part_that_is_none_is_refused_with_its_line():
    made = readings(GlassSheet, BALL, numbers={"radius_mm": [50.0]}, words={"part": ("R1",)}, **GLASS)
    with pytest.raises(InputError, match="line 2, part = 'R1'"):
        calibrate_ball(made)


def test_u_of_index_and_expansion_is_in_the_constants_of_a_prism():
    sheet = {**GLASS, "u_index_ratio": 1e-3, "u_gauge_mm": 0.0, "u_temperature_c": 0.0}
    heights = {"height_mm": [38.4] * 4}
    found = calibrate_prism(readings(GlassSheet, PRISM, numbers=heights, u_reading_mm=1e-6, **sheet))
    h, n, step = found.value("height_mm"), 1.527077, 1e-6
    for key, constant in (("hrp_mm", lambda n: h / n), ("pc_mm", lambda n: -(n - 1 / n) * h)):
        slope = (constant(n + step) - constant(n - step)) / (2 * step)
        assert found.u(key) == pytest.approx(1e-3 * abs(slope), rel=1e-4)
    assert found.covariance[1, 2] > 0  # a larger index: the point rises and the constant falls
    sheet = {**GLASS, "u_gauge_mm": 0.0, "u_temperature_c": 0.0, "u_expansion_ppm_per_c": 2.0}
    found = calibrate_prism(readings(GlassSheet, PRISM, numbers=heights, u_reading_mm=1e-9, **sheet))
    assert found.u("height_mm") == pytest.approx(38.4 * 3.0 * 2e-6, rel=1e-3)  # 3 °C above 20 °C


@draws(1000)
@pytest.mark.parametrize("count", [2, 3, 6])
def test_the_interval_covers_the_height_as_claimed_even_from_two_readings(count, runs):
    rng = np.random.default_rng(count)
    held = 0
    sheet = {**GLASS, "u_gauge_mm": 0.0, "u_temperature_c": 0.0, "temperature_c": 20.0}
    for _ in range(runs):
        height = 38.2 + 0.002 * rng.normal(size=count)
        (h, *_) = calibrate_prism(readings(GlassSheet, PRISM, numbers={"height_mm": height}, **sheet)).quantities
        held += abs(h.value - 38.2) <= h.coverage * h.u
    assert abs(held - 0.9545 * runs) < same_sigmas(27 / 1000, 1000, runs) * runs  # four standard deviations of a count


def test_claimed_scatter_keeps_the_factor_two():
    known = readings(GlassSheet, PRISM, numbers={"height_mm": [38.2, 38.201]}, u_reading_mm=0.001, **GLASS)
    assert {q.coverage for q in calibrate_prism(known).quantities} == {2.0}
