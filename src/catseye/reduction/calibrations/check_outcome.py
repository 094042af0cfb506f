"""The outcome of a test: a number, its limit, and what they mean."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CheckOutcome:
    """A statistical test or a comparison with a limit, with its outcome.

    name       "outliers: largest |w|"
    statistic  what was computed
    limit      what it was compared with
    passed     the outcome; None where the data do not allow the test
    text       what it means, one sentence
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
        """The numbers with the side on which the limit stands; "" where nothing was compared.

        >>> CheckOutcome("arc, rad", 3.0, 1.57, True, "wide enough", least=True).comparison
        '3, at least 1.57'
        """
        if self.limit != self.limit:
            return ""
        return f"{self.statistic:.4g}, at {'least' if self.least else 'most'} {self.limit:.4g}"
