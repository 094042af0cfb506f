"""Checks between parameters of a set, each with the values and the limit in its refusal."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from catseye.errors import InputError, ValidityError
from catseye.ranger.head import SamplingSettings

SHOTS_A_ROUND = 4  # at least so many must fit into a round
OF_SAMPLING = ("cycles", "samples_per_cycle", "if_hz")
STANDARDS = ("reference_every_s", "benchmark_every_s")
Values = Mapping[str, str]


@dataclass(frozen=True)
class SetInterlock:
    """A check of values together, or against the site's state.

    parameters   names of those that it compares
    rule         true statement of a legal set, with its limit
    refuse       raises InputError for values of all parameters that break it
    """

    parameters: tuple[str, ...]
    rule: str
    refuse: Callable[[Values], None]

    def refusal(self, values: Values) -> str | None:
        """Reason why values break it; None if they do not."""
        try:
            self.refuse(values)
        except InputError as problem:
            return str(problem)
        return None


def sampling_of_values(values: Values) -> SamplingSettings:
    """Sampling of a buffer.

    Raises InputError: beyond a ranger's limits.

    >>> sampling_of_values({"cycles": "128", "samples_per_cycle": "64", "if_hz": "1000"}).duration
    0.128
    """
    cycles, samples, if_hz = (int(values[name]) for name in OF_SAMPLING)
    try:
        return SamplingSettings(samples, cycles, if_hz)
    except ValidityError as problem:
        raise InputError(f"cycles; samples_per_cycle; if_hz: {problem}") from problem


def refuse_sampling(values: Values) -> None:
    """Raise InputError for a sampling beyond a ranger's limits."""
    sampling_of_values(values)


def refuse_short_round(values: Values, *, settle: float) -> None:
    """Raise InputError for a round that holds too few shots.

    settle   s before each buffer
    """
    round_s, duration = float(values["round_s"]), sampling_of_values(values).duration
    shortest = SHOTS_A_ROUND * (duration + settle)
    if shortest > round_s:
        raise InputError(
            f"round_s = {round_s:g} s holds no {SHOTS_A_ROUND} shots of {duration:g} s "
            f"(expected at least {shortest:.2f})"
        )


def refuse_low_rate(values: Values) -> None:
    """Raise InputError for a rate that gives no shot in a round."""
    round_s = float(values["round_s"])
    if float(values["rate_hz"]) * round_s < 1.0:
        raise InputError(
            f"rate_hz = {values['rate_hz']} gives no shot in round_s = {round_s:g} "
            f"(expected at least {1.0 / round_s:.3g})"
        )


def refuse_frequent_standards(values: Values) -> None:
    """Raise InputError for a reference or a benchmark more often than once a round."""
    round_s = float(values["round_s"])
    for name in STANDARDS:
        if float(values[name]) < round_s:
            raise InputError(
                f"{name} = {values[name]} is shorter than round_s = {round_s:g} (expected {round_s:g} or more)"
            )


def refuse_all_dropped(values: Values, rangers: int) -> None:
    """Raise InputError for an active mode without a ranger.

    rangers   number of the site's
    """
    dropped = [] if values["dropped"] == "none" else values["dropped"].split()
    if values["mode"] == "active" and len(dropped) >= rangers:
        raise InputError(f"mode = active with all {rangers} rangers in dropped (expected fewer, or mode hold)")


def refuse_while_passive(values: Values, before: SamplingSettings) -> None:
    """Raise InputError for another sampling in passive mode: another client commands the rangers."""
    if values["mode"] == "passive" and sampling_of_values(values) != before:
        raise InputError(
            "mode = passive: another client commands the rangers "
            "(expected cycles; samples_per_cycle; if_hz as they are)"
        )


def refuse_smaller_cone(values: Values, recorded_deg: float) -> None:
    """Raise InputError for a Sun cone below the record's."""
    if float(values["sun_cone_deg"]) < recorded_deg:
        raise InputError(
            f"sun_cone_deg = {values['sun_cone_deg']} is below the record's {recorded_deg:g} "
            f"(expected {recorded_deg:g} or more)"
        )
