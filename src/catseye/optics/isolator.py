"""Faraday isolator: transmitted light, and return into the laser.

Two polarizers with a rotator between them that turns the light the same way in both directions. In fixed transverse
axes the outward path is P(second) R(turn) P(first), the return path P(first) R(turn) P(second): this is not reciprocal.
Limits are a turn other than 45 degrees (wavelength, temperature), and leakage of the polarizers.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError

RESONANCE_UM = 0.258  # of terbium gallium garnet, whose 4f-5d transitions make its rotation
DESIGN_TURN = 0.25 * np.pi


@dataclass(frozen=True)
class Isolator:
    """Faraday isolator; the laser's field lies along the first polarizer.

    turn           rad, of the field by the rotator
    second         rad, of the second polarizer from the first
    leak           of the power of the crossed polarization, by each polarizer, 0 to 1
    transmission   of all else, each way, above 0, up to 1
    """

    turn: float = DESIGN_TURN
    second: float = DESIGN_TURN
    leak: float = 1e-4
    transmission: float = 0.92

    def __post_init__(self) -> None:
        if not 0.0 <= self.leak <= 1.0:
            raise ValidityError(f"leak {self.leak} of a polarizer is not within 0 to 1")
        if not 0.0 < self.transmission <= 1.0:
            raise ValidityError(f"transmission {self.transmission} of an isolator is not above 0 and up to 1")


def faraday_turn(
    wavelength_um: ArrayLike, temperature_c: ArrayLike = 20.0, *, design_um: float = 0.780, design_c: float = 20.0
) -> Array:
    """Turn, rad, of a terbium gallium garnet rotator, 45 degrees by design.

    wavelength_um, temperature_c   in use; um, above 0.4, and °C, -40 to 80
    design_um, design_c            of the design, where it turns by 45 degrees

    1/(l^2 - 0.258^2) by wavelength and 1/T by absolute temperature: 0.34 % or 0.15 degrees for each °C.

    Raises ValidityError outside.

    Source: [BARNES92], paramagnetic rotation near room temperature. Good to 5 % of the change.

    >>> round(float(np.degrees(faraday_turn(0.780, 30.0))), 3)
    43.516
    """
    l_um, t = np.asarray(wavelength_um, dtype=float), np.asarray(temperature_c, dtype=float)
    if not np.all(l_um > 0.4) or not design_um > 0.4:
        raise ValidityError(f"wavelength {float(np.min(l_um)):g} um is not above 0.4 um, where the garnet is clear")
    if not np.all((t >= -40.0) & (t <= 80.0)):
        raise ValidityError(f"temperature {float(np.ravel(t)[0]):g} C is outside -40 to 80 C")
    by_wavelength = (design_um**2 - RESONANCE_UM**2) / (l_um**2 - RESONANCE_UM**2)
    return DESIGN_TURN * by_wavelength * (design_c + 273.15) / (t + 273.15)


def jones_out(isolator: Isolator) -> Array:
    """Jones matrix (2, 2) of the outward path, in fixed axes.

    The first axis is along the first polarizer.

    isolator   its turn, polarizers, losses

    Source: [SALEH07] sec. 6.6. Exact for plane waves.
    """
    second, first = _polarizer(isolator.second, isolator.leak), _polarizer(0.0, isolator.leak)
    return np.sqrt(isolator.transmission) * second @ _turned(isolator.turn) @ first


def jones_back(isolator: Isolator) -> Array:
    """Jones matrix (2, 2) of the return path, in the same axes.

    isolator   its turn, polarizers, losses

    Source: [SALEH07] sec. 6.6: the rotator turns the same way as seen in space.
    """
    second, first = _polarizer(isolator.second, isolator.leak), _polarizer(0.0, isolator.leak)
    return np.sqrt(isolator.transmission) * first @ _turned(isolator.turn) @ second


def forward_share(isolator: Isolator) -> float:
    """Share of the laser's power that leaves the isolator.

    isolator   its turn, polarizers, losses

    >>> round(forward_share(Isolator()), 6)
    0.92
    """
    return float(np.sum(jones_out(isolator)[:, 0] ** 2))


def back_share(isolator: Isolator, returned: ArrayLike | None = None) -> float:
    """Share of returned power back into the laser's polarization.

    isolator   its turn, polarizers, losses
    returned   (2,) Jones vector of the returned light in the same axes, any length above 0; None for the worst case

    Light returned in its own polarization is blocked by the turn alone, sin^2 of the deviation of the two angles from a
    right angle (and the product of both leaks); light across it passes by the leak of the second polarizer.
    A corner cube without coating mixes the two.

    Raises ValidityError for no light.

    Source: derived; exact for plane waves.

    >>> from math import cos, sin, pi
    >>> round(1e4 * back_share(Isolator(turn=0.76, leak=0.0), [cos(pi / 4), sin(pi / 4)]), 3)
    5.933
    """
    row = jones_back(isolator)[0]
    if returned is None:
        return float(row @ row)
    light = np.asarray(returned, dtype=complex)
    power = float(np.sum(np.abs(light) ** 2))
    if not 0.0 < power < np.inf:
        raise ValidityError(f"returned light {returned} has no power, or no finite one")
    return float(np.abs(row @ light) ** 2) / power


def _polarizer(angle: float, leak: float) -> Array:
    """Polarizer matrix; the crossed field passes with the root of the leak."""
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-np.sin(angle), np.cos(angle)])
    return np.outer(along, along) + np.sqrt(leak) * np.outer(across, across)


def _turned(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
