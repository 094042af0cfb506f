"""Errors carry data."""

from copy import copy
from enum import Enum

from catseye.errors import EstimationError


class _Reason(Enum):
    FEW = "few"


def test_an_estimation_error_carries_a_reason_and_data_into_copies():
    error = copy(EstimationError("7 points needed, 3 found", reason=_Reason.FEW, needed=7))
    assert (str(error), error.reason, error.data) == ("7 points needed, 3 found", _Reason.FEW, {"needed": 7})
    assert EstimationError("no reason").reason is None
