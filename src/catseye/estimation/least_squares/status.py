"""Status of an adjustment: its outcome as an enum, the detail, and one text of both."""

from enum import Enum


class AdjustmentOutcome(Enum):
    """Outcome of an adjustment; the value is its text."""

    CONVERGED = "converged"
    CONTRADICTED = "converged, but {detail}"
    CONTRADICTORY = "contradictory: {detail}"  # converged, with implausibly large residuals
    NOT_CONVERGED = "not converged: {detail}"
    NOT_PLACED = "no approximate coordinates: {detail}"
    NOT_TRIED = "not tried"
    RANK_DEFICIENT = "rank deficient: {detail}"
    UNDEFINED = "undefined at the current values: {detail}"
    # a search for wrong observations
    REJECTION_UNDECIDED = "rejection undecided {detail}"
    NOT_HELD = "observations at one point contradict each other, and without them it is not held ({detail})"
    UNDECIDED = "undecided: {detail}"
    UNFINISHED = "not finished {detail}"
    # variance components
    INSEPARABLE = "not separable: {detail}"


class Status(str):
    """Status of an adjustment, one line with its parts.

    outcome   what came of it
    detail    problem and place
    advice    remedy at the end of the line

    >>> status = Status(AdjustmentOutcome.NOT_CONVERGED, "the last step was 3 m", "; check the starting coordinates")
    >>> status, status.outcome.name, status.advised("; S1 is wrong")
    ('not converged: the last step was 3 m; check the starting coordinates', 'NOT_CONVERGED', \
'not converged: the last step was 3 m; S1 is wrong')
    """

    outcome: AdjustmentOutcome
    detail: str
    advice: str
    __slots__ = ("advice", "detail", "outcome")

    def __new__(cls, outcome: AdjustmentOutcome, detail: str = "", advice: str = "") -> "Status":
        status = super().__new__(cls, outcome.value.format(detail=detail) + advice)
        status.outcome, status.detail, status.advice = outcome, detail, advice
        return status

    def __reduce__(self) -> tuple[type["Status"], tuple[AdjustmentOutcome, str, str]]:
        return Status, (self.outcome, self.detail, self.advice)

    def advised(self, advice: str) -> "Status":
        """Same status with another advice."""
        return Status(self.outcome, self.detail, advice)

    @property
    def usable(self) -> bool:
        """True if the parameters are valid within their covariance."""
        return self.outcome in (AdjustmentOutcome.CONVERGED, AdjustmentOutcome.CONTRADICTED)


CONVERGED = Status(AdjustmentOutcome.CONVERGED)
ADVICE = "; check the starting coordinates"


def not_converged(step: float, iterations: int) -> Status:
    """Status of an iteration at its cap.

    step         its last, in standard deviations
    iterations   taken
    """
    text = f"the last step was {step:.2g} standard deviations after {iterations} iterations"
    return Status(AdjustmentOutcome.NOT_CONVERGED, text, ADVICE)


def rank_deficient(names: str) -> Status:
    """Status of undetermined parameters."""
    return Status(
        AdjustmentOutcome.RANK_DEFICIENT, f"{names} not determined by any observation; add one, or give a prior"
    )


def undefined(names: str) -> Status:
    """Status of observations without finite values or derivatives."""
    text = f"{names} has no finite value or derivative there"
    return Status(AdjustmentOutcome.UNDEFINED, text, "; two points may coincide, or an observation is not a number")
