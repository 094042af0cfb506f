"""Claimed uncertainty of ranges whose file has none."""

from typing import NamedTuple

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.errors import InputError

LARGEST_MM, LARGEST_PPM = 1e5, 1e4  # larger values indicate another unit


class RangeClaim(NamedTuple):
    """Standard uncertainty a + b D of a range of D metres, as makers state it.

    mm, ppm   a and b; None if not given
    """

    mm: float | None = None
    ppm: float | None = None

    def __bool__(self) -> bool:
        return bool(self.mm or self.ppm)

    def of(self, distance: np.ndarray) -> np.ndarray:
        """Standard uncertainties of ranges (m), m.

        >>> RangeClaim(1.0, 2.0).of(np.array([100.0])).round(7).tolist()
        [0.0012]
        """
        return (self.mm or 0.0) * MILLIMETRE + (self.ppm or 0.0) * PPM * distance

    @property
    def terms(self) -> tuple[float, float, float]:
        """Terms a, b, c of a + b D^c, m."""
        return (self.mm or 0.0) * MILLIMETRE, (self.ppm or 0.0) * PPM, 1.0

    @classmethod
    def from_options(cls, mm: float | None, ppm: float | None) -> "RangeClaim":
        """Claim of two options; InputError for an invalid standard uncertainty."""
        for name, value, most in (("sigma_mm", mm, LARGEST_MM), ("sigma_ppm", ppm, LARGEST_PPM)):
            if value is not None and not 0.0 <= value <= most:
                raise InputError(f"{name} = {value:g} (expected 0 to {most:g})")
        return cls(mm, ppm)


NO_CLAIM = RangeClaim()
