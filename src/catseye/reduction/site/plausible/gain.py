"""Converters that most shots of a ranger, or of all, drive to their ends."""

import numpy as np

from catseye.records.night.campaign import Campaign
from catseye.reduction.site.plausible.record import ImplausibleRecord

MOST = 0.5  # share of a ranger's shots; a near target clips a few
ALL = 0.9  # share of all shots, so that too few remain for any network
FEWEST = 5  # shots of a ranger


def implausible_gains(campaign: Campaign, clipped: np.ndarray, largest: np.ndarray) -> list[ImplausibleRecord]:
    """Rangers that clip most of their shots; one fatal record if all do.

    clipped   (n,) bool, of each shot
    largest   (n,) V, largest magnitude of a sample
    """
    count, adc = len(clipped), campaign.site.adc
    cure = "the gain is too high, or bits or full_scale_volt of site.toml's [adc] are wrong"
    if count and clipped.sum() >= ALL * count:
        text = (
            f"{int(clipped.sum())} of {count} shots of all rangers stand at the converter's end, "
            f"{largest[clipped].max():.2f} V of {adc.full_scale_volt:g} V: {cure}; lower the gain and measure again"
        )
        return [ImplausibleRecord("frames.npy", text, "gain", campaign.rangers, fatal=True)]
    ranger, implausible = np.array(campaign.shots.ranger), []
    for name in campaign.rangers:
        of_ranger = ranger == name
        if of_ranger.sum() >= FEWEST and clipped[of_ranger].sum() > MOST * of_ranger.sum():
            text = (
                f"{int(clipped[of_ranger].sum())} of {name}'s {int(of_ranger.sum())} shots stand at the converter's "
                f"end, {largest[of_ranger & clipped].max():.2f} V: its gain is too high; these shots are left out"
            )
            implausible.append(ImplausibleRecord("frames.npy", text, "gain", (name,)))
    return implausible
