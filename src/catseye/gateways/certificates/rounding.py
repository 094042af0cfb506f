"""Numbers of a certificate, rounded by their expanded uncertainty."""

import math
from decimal import ROUND_HALF_EVEN, ROUND_UP, Decimal
from typing import NamedTuple

DIGITS = 2  # significant, of an uncertainty
EXACT = 12  # digits of a float that count: 0.1 + 0.2 is not rounded up for its last bit


class RoundedResult(NamedTuple):
    """Value, standard and expanded uncertainty as text."""

    value: str
    u: str
    expanded: str


def rounded_result(value: float, u: float, coverage: float) -> RoundedResult:
    """Result with two digits of its expanded uncertainty, rounded up; the value to the same place.

    Source: [JCGM100] 7.2.6; [ISO17] 7.8.4.1.

    >>> rounded_result(180.68514159, 0.00545, 2.0)
    RoundedResult(value='180.685', u='0.0055', expanded='0.011')
    >>> rounded_result(56789.0, 612.0, 2.0)
    RoundedResult(value='56800', u='620', expanded='1300')
    """
    expanded = coverage * u
    if not (math.isfinite(value) and math.isfinite(expanded)):
        return RoundedResult(f"{value:g}" if math.isfinite(value) else "–", "unknown", "unknown")
    if expanded <= 0.0:
        return RoundedResult(f"{value:.{EXACT}g}", "0", "0")
    limit = rounded_up(expanded)
    place = Decimal(1).scaleb(_exponent(limit))
    nearest = Decimal(repr(float(value))).quantize(place, ROUND_HALF_EVEN)
    return RoundedResult(f"{nearest + 0:f}", f"{rounded_up(u):f}", f"{limit:f}")


def rounded_up(u: float) -> Decimal:
    """Uncertainty with two significant digits, rounded up.

    >>> [str(rounded_up(u)) for u in (0.0123, 0.00995, 0.012, 12.01)]
    ['0.013', '0.010', '0.012', '13']
    """
    exact = Decimal(f"{u:.{EXACT - 1}e}")
    for _ in range(2):  # 0.0995 becomes 0.10, one digit fewer
        place = Decimal(1).scaleb(exact.adjusted() - DIGITS + 1)
        exact = exact.quantize(place, ROUND_UP)
    return exact


def _exponent(number: Decimal) -> int:
    exponent = number.as_tuple().exponent
    assert isinstance(exponent, int)  # a finite number has one
    return exponent
