"""Limits of the parameters of a simulated night."""

from catseye.errors import ValidityError


def require(what: str, value: float, low: float, high: float) -> None:
    """Raise ValidityError for a number outside low to high, or invalid."""
    if not low <= value <= high:
        raise ValidityError(f"{what} = {value:g} (expected {low:g} to {high:g})")
