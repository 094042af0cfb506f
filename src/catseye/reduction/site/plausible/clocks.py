"""Clock of a ranger against the order in which shots were numbered."""

from dataclasses import replace

import numpy as np

from catseye.constants import SECONDS_PER_DAY
from catseye.records.night.campaign import Campaign
from catseye.reduction.site.plausible.record import ImplausibleRecord

UNORDERED_S = 60.0  # chosen: rangers that work side by side number their shots in the order of arrival, seconds apart
FEWEST_RANGERS, FEWEST_SHOTS = 4, 5
MOST_CLOCKS = 0.25  # share of the rangers; more means that numbers are not in the order of time
UNIFORM = 0.2  # scatter of the shots' delay over the delay, of one clock that is late
ABREAST = 0.5  # share of a ranger's time in which the others' numbers advance with its own


def plausible_clocks(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    """Campaign with late clocks put back, and these clocks.

    The numbers of the shots keep the order in which they were fired. A ranger whose times are later or earlier by
    one and the same amount than those of shots with neighbouring numbers has a wrong clock.
    """
    shots = campaign.shots
    order = np.argsort(shots.shot, kind="stable")
    seconds = (shots.mjd_utc[order] - shots.mjd_utc[order[0]]) * SECONDS_PER_DAY
    names = np.array(shots.ranger)[order]
    rangers = np.unique(names)
    late: dict[str, float] = {}
    right = np.ones(len(order), dtype=bool)
    while len(rangers) >= FEWEST_RANGERS and _disorder(seconds[right]):
        disorder = {n: _disorder(seconds[right & (names != n)]) for n in rangers if n not in late}
        worst = min(disorder, key=lambda n: disorder[n])
        late[worst] = 0.0
        right &= names != worst
        if len(late) > max(1.0, MOST_CLOCKS * len(rangers)):
            return campaign, []
    mjd, implausible = np.array(shots.mjd_utc), []
    for name in late:
        of_ranger = np.flatnonzero(names == name)
        by_others = np.interp(of_ranger, np.flatnonzero(right), seconds[right])
        delay = seconds[of_ranger] - by_others
        size = float(np.median(delay))
        scatter = 1.4826 * float(np.median(np.abs(delay - size)))
        abreast = np.ptp(by_others) >= ABREAST * np.ptp(seconds[of_ranger])
        uniform = scatter <= UNIFORM * abs(size)
        if len(of_ranger) < FEWEST_SHOTS or not abs(size) > UNORDERED_S or not (uniform and abreast):
            return campaign, []
        mjd[order[of_ranger]] -= size / SECONDS_PER_DAY
        text = (
            f"{name}'s shots are {abs(size):.0f} s {'later' if size > 0.0 else 'earlier'} than shots of the other "
            f"rangers with neighbouring numbers (expected within {UNORDERED_S:.0f} s): its clock is wrong; its times "
            "are moved by that much, set them right"
        )
        implausible.append(ImplausibleRecord("shots.csv: mjd_utc", text, "clock", (name,)))
    return (replace(campaign, shots=replace(shots, mjd_utc=mjd)), implausible) if implausible else (campaign, [])


def _disorder(seconds: np.ndarray) -> int:
    """Number of shots that are earlier than one before them in order."""
    return int(np.count_nonzero(seconds < np.maximum.accumulate(seconds) - UNORDERED_S))
