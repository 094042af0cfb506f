"""Zeros of an archive: of the ranges alone, from one sheet, one series a head."""

import numpy as np
import pytest

from catseye.reduction.trends import tables
from catseye.reduction.trends.tables import ArchivedNights, read_zeros

NIGHTS = 4
SHEET_U, RANGES_U = 10e-6, 3e-6  # m


@pytest.fixture
def nights():
    columns = {name: np.zeros(NIGHTS) for name in ArchivedNights.__dataclass_fields__}
    night = np.array([f"night-{k}" for k in range(NIGHTS)])
    return ArchivedNights(**{**columns, "night": night, "mjd": 61041.0 + np.arange(NIGHTS)})


def archive(monkeypatch, nights, d0, heads):
    """An archive whose zeros depart from each night's sheet so that the head's own zero is 0.5 mm throughout."""
    own = 0.5e-3 - (np.array(d0) - d0[-1])
    adjusted = (SHEET_U**-2 + RANGES_U**-2) ** -0.5
    value = own * (adjusted / RANGES_U) ** 2  # weighted mean of the ranges' value and a prior of 0
    zeros = {
        "ranger": np.array(["ZY101"] * NIGHTS),
        "parameter": np.array(["zero"] * NIGHTS),
        "night": nights.night,
        "mjd": nights.mjd,
        "value": value,
        "u": np.full(NIGHTS, 12.2e-6),  # with what all heads have in common: more than the sheet's
        "u_adjusted": np.full(NIGHTS, adjusted),
        "prior": np.zeros(NIGHTS),
        "u_prior": np.full(NIGHTS, SHEET_U),
        "temperature_c": np.full(NIGHTS, 4.0),
    }
    sheets = {
        "night": nights.night,
        "mjd": nights.mjd,
        "instrument": np.array(heads),
        "value": np.array(d0),
        "ranger": np.array(["ZY101"] * NIGHTS),
        "kind": np.array(["mirror"] * NIGHTS),
    }
    monkeypatch.setattr(tables, "_of_nights", lambda _, kind, *rest: {"zeros": zeros, "certificates": sheets}[kind])


def test_a_new_sheet_is_no_step_of_the_head(monkeypatch, nights):
    archive(monkeypatch, nights, [1.0, 1.0, 1.0002, 1.0002], ["Z1"] * NIGHTS)
    (series,) = read_zeros(None, nights)
    assert series.subject == "ZY101"
    assert series.value == pytest.approx(np.full(NIGHTS, 0.5e-3), abs=1e-12)
    assert series.u == pytest.approx(np.full(NIGHTS, RANGES_U), rel=1e-9)
    assert series.prior == pytest.approx([-2e-4, -2e-4, 0.0, 0.0])


def test_another_head_is_another_series(monkeypatch, nights):
    archive(monkeypatch, nights, [1.0] * NIGHTS, ["Z1", "Z1", "Z2", "Z2"])
    assert {series.subject: len(series.mjd) for series in read_zeros(None, nights)} == {
        "ZY101 with Z1": 2,
        "ZY101 with Z2": 2,
    }
