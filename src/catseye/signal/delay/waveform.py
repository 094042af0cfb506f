"""Known acoustic signals, zero outside 0 to their duration.

They start and end smoothly, so that they can be sampled: components above half the sampling frequency are aliased.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError

TAPS: dict[int, tuple[int, ...]] = {  # exponents of a primitive polynomial between the highest and the constant
    3: (2,), 4: (3,), 5: (3,), 6: (5,), 7: (6,), 8: (6, 5, 4), 9: (5,), 10: (7,), 11: (9,), 12: (6, 4, 1),
}  # fmt: skip
LONGEST = 1e7  # samples


def chirp(time: ArrayLike, *, start_hz: float, stop_hz: float, duration: float, taper: float = 0.1) -> NDArray:
    """Sine with linear frequency sweep from start to stop.

    time               s, any shape
    start_hz, stop_hz  Hz, above 0, falling or rising
    duration           s
    taper              share of the duration over which it rises, and falls, as a raised cosine, 0 to 0.5

    Raises ValidityError for values outside these.

    >>> float(chirp(0.0, start_hz=1e3, stop_hz=3e3, duration=0.02))
    0.0
    """
    _above_zero(start_hz=start_hz, stop_hz=stop_hz, duration=duration)
    if not 0.0 <= taper <= 0.5:
        raise ValidityError(f"taper {taper} is outside 0 to 0.5, share of the duration at each end")
    t = np.asarray(time, float)
    angle = TWO_PI * (start_hz * t + 0.5 * (stop_hz - start_hz) * t * t / duration)
    inner = np.clip(np.minimum(t, duration - t) / (taper * duration if taper else 1e-300), 0.0, 1.0)
    return np.where((t > 0.0) & (t < duration), np.sin(angle) * np.sin(0.5 * np.pi * inner) ** 2, 0.0)


def pulse(time: ArrayLike, *, centre_hz: float, duration: float) -> NDArray:
    """Sine under one raised-cosine arch.

    time        s, any shape
    centre_hz   Hz, above 0
    duration    s; the band is about 2/duration wide at half its height

    Raises ValidityError for values outside these.

    >>> float(np.round(pulse(0.5e-3, centre_hz=5e3, duration=1e-3), 6))
    1.0
    """
    _above_zero(centre_hz=centre_hz, duration=duration)
    t = np.asarray(time, float)
    wave = np.cos(TWO_PI * centre_hz * (t - 0.5 * duration)) * np.sin(np.pi * t / duration) ** 2
    return np.where((t > 0.0) & (t < duration), wave, 0.0)


def maximum_length_chips(order: int) -> NDArray:
    """One period of a maximum length sequence of chips +1, -1.

    order   3 to 12; the length is 2^order - 1

    Its circular autocorrelation is 2^order - 1 at zero and -1 elsewhere. Raises ValidityError for another order.

    >>> [int(chip) for chip in maximum_length_chips(3)]
    [-1, -1, -1, 1, -1, 1, 1]
    """
    if order not in TAPS:
        raise ValidityError(f"order {order} of a maximum length sequence is outside 3 to 12")
    bits = [1] * order
    for _ in range(2**order - 1 - order):
        new = bits[-order]
        for tap in TAPS[order]:
            new ^= bits[-order + tap]
        bits.append(new)
    return 1.0 - 2.0 * np.array(bits)


def maximum_length_sequence(time: ArrayLike, *, order: int, chip_hz: float, centre_hz: float = 0.0) -> NDArray:
    """Maximum length sequence of raised-cosine chips, on an optional carrier.

    time        s, any shape
    order       3 to 12: the duration is (2^order + 1)/chip_hz
    chip_hz     chips a second, above 0; the band reaches to chip_hz on either side of the carrier
    centre_hz   Hz, 0 for none

    Raises ValidityError for values outside these.

    >>> float(np.round(maximum_length_sequence(1.0 / 4e3, order=5, chip_hz=4e3), 9))  # the top of the first chip
    -1.0
    """
    _above_zero(chip_hz=chip_hz)
    chips = np.concatenate([[0.0], maximum_length_chips(order), [0.0, 0.0]])
    t = np.asarray(time, float) * chip_hz
    at = np.clip(np.floor(t).astype(np.int64), 0, len(chips) - 2)
    rise = np.sin(0.5 * np.pi * (t - at)) ** 2
    wave = (chips[at] * (1.0 - rise) + chips[at + 1] * rise) * np.cos(TWO_PI * centre_hz * np.asarray(time, float))
    return np.where((t > 0.0) & (t < len(chips) - 1), wave, 0.0)


KINDS: dict[str, Callable[..., NDArray]] = {"chirp": chirp, "pulse": pulse, "mls": maximum_length_sequence}


def sampled(kind: str, sampling_hz: float, **values: float) -> NDArray:
    """Samples (m,) of a known signal from start to end.

    kind          one of KINDS
    sampling_hz   Hz, more than twice its highest frequency
    values        as its function takes them

    Raises ValidityError for an unknown kind, a value outside its function's limits, or a frequency above half
    the sampling frequency.

    >>> len(sampled("chirp", 16e3, start_hz=1e3, stop_hz=3e3, duration=0.02))
    321
    """
    if kind not in KINDS:
        raise ValidityError(f"signal {kind!r} is not one of {', '.join(KINDS)}")
    _above_zero(sampling_hz=sampling_hz)
    if kind == "mls":
        duration = (2.0 ** values["order"] + 1.0) / values["chip_hz"]
        highest = values.get("centre_hz", 0.0) + values["chip_hz"]
    else:
        duration = values["duration"]
        highest = max(values.get("start_hz", 0.0), values.get("stop_hz", 0.0))
        if kind == "pulse":
            highest = values["centre_hz"] + 2.0 / duration
    if not highest < 0.5 * sampling_hz:
        raise ValidityError(
            f"a {kind} up to {highest:g} Hz is not below half of {sampling_hz:g} samples a second; sample faster"
        )
    if not duration * sampling_hz < LONGEST:
        raise ValidityError(f"a {kind} of {duration:g} s has more than {LONGEST:g} samples; take a shorter one")
    time = np.arange(int(np.ceil(duration * sampling_hz - 1e-9)) + 1) / sampling_hz
    return KINDS[kind](time, **values)


def _above_zero(**values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValidityError(f"{name} {value} is not a positive number")
