"""Columns of an epoch's ranges, and the chain from a phase to a range."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from catseye.constants import SPEED_OF_LIGHT
from catseye.reduction.live.ranges import range_columns, range_steps

NAMES = ("used", "range_", "u_range", "residual", "standardised", "redundancy", "cycles", "phase", "refractivity")
CORRECTIONS = ("glass", "obliquity", "zero", "leakage", "moved", "head")
MODULATION = 1.5e9


def ranges(count):
    """Ranges with values that tell their rows and columns apart."""
    table = {name: np.arange(count) + 0.01 * k for k, name in enumerate((*NAMES, *CORRECTIONS))}
    return SimpleNamespace(shot=np.arange(count)[::-1], **table)


def test_joined_repeats_share_their_row_and_shots_are_in_order():
    rows = [SimpleNamespace(numbers=numbers) for numbers in ((7,), (3, 5), (4,))]
    columns = range_columns(ranges(3), rows)
    assert columns["shot"] == [3, 4, 5, 7]
    made = ranges(3)
    row_of = {3: 1, 5: 1, 4: 0, 7: 2}  # shots are indices of rows: the last row first
    assert columns["residual"] == [made.residual[row_of[shot]] for shot in columns["shot"]]
    assert columns["refractivity_ppm"] == pytest.approx([1e6 * made.refractivity[row_of[s]] for s in columns["shot"]])


def test_chain_is_the_length_in_air_with_all_corrections():
    """By hand: 1000 half wavelengths less a quarter turn, 250 ppm of air, D0, and six corrections."""
    columns = {"shot": [12], "cycles": [1000], "phase": [0.5 * math.pi], "refractivity_ppm": [250.0]}
    columns |= {name: [1e-3 * (k + 1)] for k, name in enumerate(CORRECTIONS)}
    columns |= {name: [0.0] for name in ("u_range", "residual", "w", "redundancy")}
    half = SPEED_OF_LIGHT / MODULATION / 2.0
    steps = {name: value for name, value, _ in range_steps(columns, 12, d0=0.18, modulation_hz=MODULATION)}
    assert steps["optical length"] == pytest.approx(999.75 * half)
    air = 999.75 * half / 1.00025
    assert steps["vacuum to air"] == pytest.approx(air - 999.75 * half)
    assert steps["range"] == pytest.approx(air + 0.18 + 0.021)
    assert range_steps(columns, 13, d0=0.18, modulation_hz=MODULATION) == ()
    assert range_steps({}, 12, d0=0.18, modulation_hz=MODULATION) == ()
