"""Limits of what a simulated night is made of."""

from catseye.errors import ValidityError


def require(what: str, value: float, low: float, high: float) -> None:
    """Raise ValidityError for a number outside low to high, and for one that is none."""
    if not low <= value <= high:
        raise ValidityError(f"{what} = {value:g} (expected {low:g} to {high:g})")
