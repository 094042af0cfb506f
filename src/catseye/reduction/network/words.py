"""Numbers and names of networks in words, for verdicts and passages."""

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE

NAMED = 5  # most names in a sentence


def quantity(value: float, unit: str) -> str:
    """Small value with three digits in a suitable unit: mm, arc seconds, or as it is.

    >>> quantity(0.000123456, "m"), quantity(1.5e-5, "rad"), quantity(2e-6, "1"), quantity(float("nan"), "m")
    ('0.123 mm', '3.09″', '2e-06', 'unknown')
    """
    if not np.isfinite(value):
        return "unknown"
    if unit == "m":
        return f"{value / MILLIMETRE:.3g} mm"
    return f"{value / ARCSECOND:.3g}″" if unit == "rad" else f"{value:.3g}"


def listed(names: list[str] | tuple[str, ...], total: int | None = None) -> str:
    """First names, and the number of the others.

    >>> listed(["A", "B", "C", "D", "E", "F"])
    'A, B, C, D, E and 1 more'
    """
    count = len(names) if total is None else total
    text = ", ".join(names[:NAMED])
    return text + (f" and {count - NAMED} more" if count > NAMED else "")
