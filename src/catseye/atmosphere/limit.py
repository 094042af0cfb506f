"""Validity limits of formulas of the air, and limits of input uncertainties."""

from dataclasses import dataclass

import numpy as np

from catseye.errors import ValidityError

GREATEST_SPREAD = 1e4  # standard uncertainties, in each quantity's unit


@dataclass(frozen=True)
class ValidInterval:
    """Closed interval in which a formula holds for one quantity.

    quantity   its name in messages
    unit       its unit in messages
    lower      least legal value
    upper      greatest legal value
    source     bibliography key or reason of the limit
    places     decimals to print the limits with
    """

    quantity: str
    unit: str
    lower: float
    upper: float
    source: str
    places: int = 0

    def check(self, value) -> None:
        """Raise ValidityError naming the first value outside, with the mask of all.

        NaN counts as outside.
        """
        values = np.asarray(value, float)
        outside = ~((values >= self.lower) & (values <= self.upper))
        if not np.any(outside):
            return
        at = int(np.flatnonzero(outside)[0])
        first = float(values.flat[at])
        count = int(np.count_nonzero(outside))
        remainder = f", and {count - 1} more" if count > 1 else ""
        where = f" (element {at} of {values.size}{remainder})" if values.ndim else ""
        span = f"{self.lower:.{self.places}f}{'-' if self.lower >= 0 else ' to '}{self.upper:.{self.places}f}"
        mask = outside if values.ndim else None
        if np.isnan(first):
            raise ValidityError(f"{self.quantity} is not a number{where}; give a value in {span} {self.unit}", mask)
        digits = f"{first:g}" if not self.lower <= float(f"{first:g}") <= self.upper else repr(first)  # 100.0000001 %
        raise ValidityError(
            f"{self.quantity} {digits} {self.unit}{where} is outside {span} {self.unit}, where {self.source} holds",
            mask,
        )


def check_spreads(**spreads) -> None:
    """Raise ValidityError for a standard uncertainty below zero, infinite or not a number."""
    for name, value in spreads.items():
        ValidInterval(
            name, "of its quantity's unit", 0.0, GREATEST_SPREAD, "the definition of a standard uncertainty"
        ).check(value)
