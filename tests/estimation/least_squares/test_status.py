"""Status of an adjustment: outcome, detail, one text; and the error that carries them."""

import json
from copy import copy, deepcopy

import numpy as np
import pytest

from catseye.errors import EstimationError
from catseye.estimation.least_squares.status import (
    CONVERGED,
    AdjustmentOutcome,
    Status,
    not_converged,
    rank_deficient,
    undefined,
)


@pytest.mark.parametrize("outcome", AdjustmentOutcome)
def test_every_outcome_has_one_text_that_holds_its_detail(outcome):
    status = Status(outcome, "here")
    assert status == outcome.value.replace("{detail}", "here")
    assert len({each.value for each in AdjustmentOutcome}) == len(AdjustmentOutcome)
    assert status.usable == status.startswith("converged")


def test_a_status_is_its_text_in_files_and_keeps_its_parts_in_copies():
    status = not_converged(12.345, 50)
    assert json.loads(json.dumps(status)) == (
        "not converged: the last step was 12 standard deviations after 50 iterations; check the starting coordinates"
    )
    again = deepcopy(status)
    assert (again, again.outcome, again.advice) == (
        status,
        AdjustmentOutcome.NOT_CONVERGED,
        "; check the starting coordinates",
    )
    assert CONVERGED == "converged"
    assert CONVERGED.usable
    assert not_converged(np.inf, 0).detail.startswith("the last step was inf standard deviations")


def test_advice_is_replaced_not_cut_off():
    assert not_converged(2.0, 3).advised("").endswith("after 3 iterations")
    assert undefined("rod").outcome is AdjustmentOutcome.UNDEFINED
    assert rank_deficient("x of A").startswith("rank deficient: x of A not determined by any observation; ")


def test_an_estimation_error_carries_a_reason_and_data_into_copies():
    error = copy(EstimationError("7 points needed, 3 found", reason=AdjustmentOutcome.NOT_PLACED, needed=7))
    assert (str(error), error.reason, error.data) == (
        "7 points needed, 3 found",
        AdjustmentOutcome.NOT_PLACED,
        {"needed": 7},
    )
    assert EstimationError("no reason").reason is None
