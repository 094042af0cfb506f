"""Outcome of a test: a number, its limit, and their meaning."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CheckOutcome:
    """Statistical test or comparison with a limit, with its outcome.

    name       "outliers: largest |w|"
    statistic  computed value
    limit      of the statistic
    passed     the outcome; None where the data do not allow the test
    text       its meaning, one sentence
    least      the limit is the least that passes, not the most
    grave      a failure rejects the answer; otherwise it casts doubt on it
    """

    name: str
    statistic: float
    limit: float
    passed: bool | None
    text: str
    least: bool = False
    grave: bool = True

    @property
    def comparison(self) -> str:
        """Statistic with the side of its limit; "" without a comparison.

        >>> CheckOutcome("arc, rad", 3.0, 1.57, True, "wide enough", least=True).comparison
        '3, at least 1.57'
        """
        if self.limit != self.limit:
            return ""
        return f"{self.statistic:.4g}, at {'least' if self.least else 'most'} {self.limit:.4g}"
