"""Hanging wire between two marks: straight distance from its length.

Weight, stretch and tension are included.

With s the unstretched length from the end A where the tension acts, H the horizontal and V(s) = V_A + w s the vertical
part of the force and T its size, dx = (H/T + H/EA) ds and dz = (V/T + V/EA) ds; both integrate in closed form.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError

ITERATIONS = 60
SETTLED = 1e-15  # of the tension


def span(
    length: ArrayLike,
    *,
    tension: ArrayLike,
    weight_per_metre: ArrayLike,
    stiffness: ArrayLike,
    height_difference: ArrayLike = 0.0,
) -> NDArray[np.float64]:
    """Horizontal distance between ends of a hanging elastic wire, m.

    length              m, above 0: unstretched, at its temperature
    tension             N, above 0: on the end A, along the wire there
    weight_per_metre    N/m, 0 or more
    stiffness           N, above 0: modulus of elasticity times area, E A
    height_difference   m: the other end above A

    Raises ValidityError for invalid sizes, and where the wire cannot reach so high.

    Source: [IRVINE81] section 1.4, solved for a given tension at one end. Exact for a wire without bending stiffness;
    its sag is the familiar -w^2 L^3 / 24 T^2 to first order, its stretch T L / E A.

    >>> round(float(span(24.0, tension=100.0, weight_per_metre=0.17, stiffness=4.1e5)), 6)
    24.004187
    """
    s, force, w, ea, h = np.broadcast_arrays(
        *(np.asarray(v, dtype=float) for v in (length, tension, weight_per_metre, stiffness, height_difference))
    )
    for name, value in (("length", s), ("tension", force), ("stiffness", ea)):
        if not np.all((value > 0.0) & np.isfinite(value)):
            raise ValidityError(f"{name} {np.min(value)} of the wire is not above 0 and finite")
    if not np.all(w >= 0.0):
        raise ValidityError(f"weight {np.min(w)} N/m of the wire is below 0")
    vertical = h / s * force - 0.5 * w * s
    for _ in range(ITERATIONS):
        far_tension = np.sqrt(
            np.maximum(force**2 + 2.0 * vertical * w * s + (w * s) ** 2, 0.0)
        )  # tension at the far end
        rise = (vertical * s + 0.5 * w * s**2) / ea + (2.0 * vertical * s + w * s**2) / (far_tension + force)
        step = (h - rise) / (s / ea + s / np.maximum(far_tension, 1e-9 * force))
        vertical = vertical + step
        if np.all(np.abs(step) <= SETTLED * force):
            break
    if not np.all(np.abs(vertical) < force):
        raise ValidityError(
            f"a wire of {np.max(s)} m under {np.min(force)} N cannot join ends {np.max(np.abs(h))} m apart in height"
        )
    far_tension = np.sqrt(force**2 + 2.0 * vertical * w * s + (w * s) ** 2)
    level = np.sqrt((force - vertical) * (force + vertical))
    # H/w (asinh(V_B/H) - asinh(V_A/H)) without its cancellation for light wires
    turned = s * (force - vertical * (2.0 * vertical + w * s) / (far_tension + force)) / level**2
    bent = np.where(w > 0.0, np.arcsinh(w * turned) / np.where(w > 0.0, w, 1.0), turned)
    return level * s / ea + level * bent


def unstretched(certified: float, *, tension: float, weight_per_metre: float, stiffness: float, hanging: bool) -> float:
    """Unstretched length of a wire certified under tension, m.

    certified           m, above 0: the certificate's
    tension             N, above 0, at calibration
    weight_per_metre    N/m, 0 or more
    stiffness           N, above 0
    hanging             certified as the level distance between the ends of the hanging wire; else as its length
                        supported throughout

    Source: [IRVINE81] section 1.4 inverted. Exact.

    >>> flat = unstretched(24.0, tension=100.0, weight_per_metre=0.17, stiffness=4.1e5, hanging=False)
    >>> round(flat, 6)
    23.994148
    """
    if not certified > 0.0 or not tension > 0.0 or not stiffness > 0.0:
        raise ValidityError(f"certified length {certified} m, tension {tension} N, stiffness {stiffness} N: above 0")
    length = certified / (1.0 + tension / stiffness)
    if not hanging:
        return length
    for _ in range(ITERATIONS):
        size = {"tension": tension, "weight_per_metre": weight_per_metre, "stiffness": stiffness}
        miss = certified - float(span(length, **size))
        length += miss
        if abs(miss) < 1e-13 * certified:
            break
    return length


def expanded(length: ArrayLike, temperature_c: ArrayLike, expansion_per_c: ArrayLike) -> NDArray[np.float64]:
    """Length at a temperature from length at 20 °C, same unit.

    length            at 20 °C
    temperature_c     °C
    expansion_per_c   1/°C: 11.5e-6 steel, 0.6e-6 Invar, say

    Source: definition of the mean coefficient; [ISO22] for 20 °C. Valid for a constant coefficient.

    >>> round(float(expanded(100.0, 23.0, 11.5e-6)), 5)
    100.00345
    """
    return np.asarray(length, float) * (1.0 + np.asarray(expansion_per_c, float) * (np.asarray(temperature_c) - 20.0))
