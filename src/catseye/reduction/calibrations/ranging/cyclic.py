"""Uncorrected cyclic terms as effects on a range."""

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.reduction.calibrations.fit import Effect
from catseye.signal.systematics.cyclic import cyclic_design

UNCORRECTED = 2  # orders: leakage and crosstalk make the first, imbalance of the quadratures the second


def cyclic_effects(phase_fraction: np.ndarray, u_cyclic_mm: float, orders: int = UNCORRECTED) -> list[Effect]:
    """Range error by each cosine and sine, (m,) m per mm.

    All with the same prior.

    phase_fraction   (m,) rad, phase after the electronics'
    u_cyclic_mm      mm, 0 or more
    orders           1 to this
    """
    columns = cyclic_design(phase_fraction, orders) * MILLIMETRE
    names = [f"cyclic {part} of order {k}" for part in ("cosine", "sine") for k in range(1, orders + 1)]
    return [Effect(name, column, u_cyclic_mm, "mm") for name, column in zip(names, columns.T, strict=True)]
