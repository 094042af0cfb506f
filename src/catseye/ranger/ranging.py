"""Distance or group index that a ZY reports for a phase.

A preliminary answer: leakage, amplitude, cyclic and axis corrections are the reduction's, which starts from the buffer.
"""

import math

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError

MODULATION_HZ = 1.5e9
HALF_WAVE_MM = SPEED_OF_LIGHT / (2.0 * MODULATION_HZ) * 1e3  # 99.930 819 33 mm in vacuum
NOMINAL_INDEX = 1.000253247  # 20 C, 933 hPa, 50 %: [PARKER04] eq. 1.49


def distance_mm(
    phase: float, reference: float, coarse_mm: float, *, index: float, d0_mm: float, constant_mm: float = 0.0
) -> float:
    """Distance from the scan point to a target, mm.

    phase, reference   rad, of the target's and of the internal cube's buffer
    coarse_mm          distance by coordinates, good to a quarter wavelength, 50 mm
    index              group index of air
    d0_mm              distance of the internal cube
    constant_mm        of the target's prism, below zero; 0 for a hollow cube

    Source: [PARKER04] eq. 5.18; D = (N - p/2pi) c/2fn + P + D0 with p = phase - reference, which falls as D grows (eq.
    5.9; 5.14 and 5.17 print the cycles' sign wrong).

    >>> f"{distance_mm(1.0, 1.0, 180.0, index=NOMINAL_INDEX, d0_mm=181.2):.3f}"
    '181.200'
    """
    waves = _waves(phase, reference, index * (coarse_mm - constant_mm - d0_mm))
    return waves * HALF_WAVE_MM / index + constant_mm + d0_mm


def group_index(
    phase: float, reference: float, certified_mm: float, *, index: float, d0_mm: float, constant_mm: float = 0.0
) -> float:
    """Group index of the air on the path to a benchmark.

    certified_mm   distance of the benchmark; the rest as for `distance_mm`, `index` near the answer

    Raises ValidityError: the benchmark is no further than the internal cube.

    Source: [PARKER04] eq. 5.18 solved for the index; the phase falls as it rises (eq. 1.31 prints the other sign).
    """
    path = certified_mm - constant_mm - d0_mm
    if path < HALF_WAVE_MM:
        raise ValidityError(f"benchmark at {certified_mm:g} mm is not beyond the internal cube at {d0_mm:g} mm")
    return _waves(phase, reference, index * path) * HALF_WAVE_MM / path


def _waves(phase: float, reference: float, optical_mm: float) -> float:
    """N - p/2pi nearest to an optical length."""
    fraction = math.fmod(phase - reference, TWO_PI) / TWO_PI
    return round(optical_mm / HALF_WAVE_MM + fraction) - fraction
