"""Contributions that the uncertainty of an index or of a speed of sound includes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

WEATHER = ("temperature", "pressure", "humidity")  # inputs of every index and every speed of sound


def stated_inputs(**u: ArrayLike) -> tuple[str, ...]:
    """Names of the inputs with an uncertainty above zero, in order.

    >>> stated_inputs(temperature=0.1, pressure=0.0, humidity=[0.0, 2.0])
    ('temperature', 'humidity')
    """
    return tuple(name for name, value in u.items() if np.any(np.asarray(value, dtype=float) > 0.0))


def contributions(stated: Sequence[str], inputs: Sequence[str] = WEATHER) -> str:
    """Contributions that an uncertainty includes, as text.

    stated   of `stated_inputs`
    inputs   that a complete uncertainty has

    >>> contributions(("temperature",))
    'includes the formula and temperature; not given: pressure, humidity'
    """
    missing = [name for name in inputs if name not in stated]
    if not stated:
        return "that of the formula only; those of the sensors are not given"
    if not missing:
        return "includes the formula and the sensors"
    return f"includes the formula and {', '.join(stated)}; not given: {', '.join(missing)}"


def uncertainty_words(stated: Sequence[str], inputs: Sequence[str] = WEATHER) -> str:
    """Sentence on the contributions that an uncertainty includes.

    stated   of `stated_inputs`
    inputs   that a complete uncertainty has

    >>> uncertainty_words(())
    'u is that of the formula only; those of the sensors are not given'
    """
    return f"u {'' if stated else 'is '}{contributions(stated, inputs)}"
