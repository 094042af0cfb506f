"""Gauge blocks and spacers: planted zeros and scales, correlations by shared blocks, wrong words."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.calibrations.length.gauge_blocks import (
    BLOCKS,
    SPACERS,
    BlocksSheet,
    SpacersSheet,
    calibrate_against_blocks,
    calibrate_spacers,
)
from reduction.calibrations.length_scene import readings

CERTIFIED = {"100": 100.00021, "50": 49.99990, "25": 25.00004, "10": 10.00001}
STEEL = {"expansion_ppm_per_c": 11.5, "u_expansion_ppm_per_c": 1.0, "u_temperature_c": 0.1}
STACKS = ("10", "25", "50", "50+25", "100", "100+25", "100+50", "100+50+25+10")


def against_blocks(reads, temperature_c, *, u_block=1e-4, **keys):
    blocks = [{"name": n, "length_mm": length, "u_mm": u_block} for n, length in CERTIFIED.items()]
    made = readings(
        BlocksSheet,
        BLOCKS,
        numbers={"reads_mm": reads},
        words={"blocks": STACKS},
        block=blocks,
        temperature_c=temperature_c,
        film_um=0.02,
        u_film_um=0.01,
        **STEEL,
        **keys,
    )
    return calibrate_against_blocks(made)


def lengths(lengths_by_name):
    return np.array([sum(lengths_by_name[n] for n in s.split("+")) + 2e-5 * s.count("+") for s in STACKS])


def test_a_planted_zero_and_scale_are_found_with_every_correction():
    true = lengths(CERTIFIED) * (1 + 11.5e-6 * 2.5)
    found = against_blocks(0.0123 + true * (1 + 40e-6), 22.5, u_reading_mm=1e-4)
    assert found.value("zero_mm") == pytest.approx(0.0123, abs=1e-9)
    assert found.value("scale_ppm") == pytest.approx(40.0, abs=1e-4)


def test_zero_and_scale_scatter_as_their_covariance_with_shared_blocks():
    rng = np.random.default_rng(8)
    found, claimed = [], []
    for _ in range(400):
        blocks = {n: length + 3e-4 * rng.normal() for n, length in CERTIFIED.items()}
        warm, expansion = 22.5 + 0.1 * rng.normal(), 11.5 + 1.0 * rng.normal()
        reads = lengths(blocks) * (1 + 1e-6 * expansion * (warm - 20)) + 1e-4 * rng.normal(size=len(STACKS))
        c = against_blocks(reads, 22.5, u_block=3e-4, u_reading_mm=1e-4)
        found.append([c.value("zero_mm"), c.value("scale_ppm")])
        claimed.append(c.covariance)
    scatter, claim = np.cov(np.array(found).T), np.mean(claimed, axis=0)
    u = np.sqrt(np.diag(claim))
    assert np.all(np.abs(scatter - claim) / np.outer(u, u) < 0.25)
    assert np.all(np.abs(np.mean(found, axis=0)) < 4 * u / 20)


def test_spacers_share_their_instruments_uncertainty():
    sheet = {"zero_mm": 0.01, "u_zero_mm": 0.002, "scale_ppm": 40.0, "u_scale_ppm": 0.0, "temperature_c": 20.0}
    made = readings(
        SpacersSheet,
        SPACERS,
        numbers={"reads_mm": [88.92, 88.921, 30.01, 30.0105]},
        words={"spacer": ("A", "A", "B", "B")},
        u_reading_mm=0.0005,
        **sheet,
        **STEEL,
    )
    found = calibrate_spacers(made)
    assert found.value("A_mm") == pytest.approx((88.9205 - 0.01) / (1 + 40e-6), abs=1e-9)
    difference = found.covariance[0, 0] + found.covariance[1, 1] - 2 * found.covariance[0, 1]
    assert found.u("A_mm") == pytest.approx(np.hypot(0.002, 0.0005 / np.sqrt(2)), rel=0.01)
    assert np.sqrt(difference) == pytest.approx(0.0005, rel=0.01)  # the instrument's zero cancels


def test_unknown_and_repeated_blocks_are_refused():
    block = [{"name": "10", "length_mm": 10.0, "u_mm": 1e-4}]
    for stack, why in (("10+5", "'5' has no"), ("10+10", "stands twice")):
        made = readings(
            BlocksSheet,
            BLOCKS,
            numbers={"reads_mm": [10.0]},
            words={"blocks": (stack,)},
            block=block,
            temperature_c=20.0,
            **STEEL,
        )
        with pytest.raises(InputError, match=f"line 2, blocks = .*{why}"):
            calibrate_against_blocks(made)


def test_the_scale_of_the_instrument_and_the_warmth_are_taken_out_of_a_spacer_and_their_u_counts():
    base = {"expansion_ppm_per_c": 20.0, "u_expansion_ppm_per_c": 0.0, "u_temperature_c": 0.0, "u_zero_mm": 0.0}
    made = readings(
        SpacersSheet, SPACERS, numbers={"reads_mm": [500.0]}, words={"spacer": ("A",)},
        scale_ppm=100.0, u_scale_ppm=4.0, temperature_c=30.0, u_reading_mm=1e-6, **base,
    )  # fmt: skip
    found = calibrate_spacers(made)
    assert found.value("A_mm") == pytest.approx(500.0 - 0.05 - 0.1, abs=2e-4)  # 100 ppm, and 20 ppm/°C over 10 °C
    assert found.u("A_mm") == pytest.approx(500.0 * 4e-6, rel=1e-3)


def test_the_doubt_of_the_films_falls_on_stacks_and_not_on_single_blocks():
    blocks = [{"name": n, "length_mm": length, "u_mm": 1e-9} for n, length in CERTIFIED.items()]
    steel = {**STEEL, "u_expansion_ppm_per_c": 0.0, "u_temperature_c": 0.0, "u_reading_mm": 1e-6}
    for stack, films in (("100", 0), ("50+25+10", 2)):
        made = readings(
            BlocksSheet, BLOCKS, numbers={"reads_mm": [90.0]}, words={"blocks": (stack,)}, block=blocks,
            temperature_c=20.0, u_film_um=0.05, estimate_scale=False, **steel,
        )  # fmt: skip
        assert calibrate_against_blocks(made).u("zero_mm") == pytest.approx(np.hypot(1e-6, films * 5e-5), rel=1e-3)


def test_a_spacer_without_a_name_is_refused_with_its_line():
    made = readings(
        SpacersSheet, SPACERS, numbers={"reads_mm": [10.0, 10.0]}, words={"spacer": ("A", "")}, temperature_c=20.0,
        u_zero_mm=0.0, u_scale_ppm=0.0, **STEEL,
    )  # fmt: skip
    with pytest.raises(InputError, match="line 3, spacer is empty"):
        calibrate_spacers(made)
