"""Records of a campaign that no site has."""

from collections.abc import Sequence

from catseye.errors import InputError
from catseye.records.night.campaign import Campaign
from catseye.reduction.site.plausible.clocks import plausible_clocks
from catseye.reduction.site.plausible.lengths import plausible_lengths
from catseye.reduction.site.plausible.posture import implausible_posture, posture_by_ground_prisms
from catseye.reduction.site.plausible.record import ImplausibleRecord, listed
from catseye.reduction.site.plausible.weather import plausible_weather


def plausible_campaign(campaign: Campaign) -> tuple[Campaign, tuple[ImplausibleRecord, ...]]:
    """Campaign without what is implausible, and what that was.

    Raises InputError where nothing else gives a quantity.
    """
    campaign, implausible = _examined(campaign)
    refuse_fatal(implausible)
    return campaign, implausible


def refuse_fatal(records: Sequence[ImplausibleRecord]) -> None:
    """Raise InputError for the first fatal record; it names others like it."""
    fatal = [record for record in records if record.fatal]
    if fatal:
        alike = tuple(n for record in fatal[1:] if record.where == fatal[0].where for n in record.owners)
        raise InputError(fatal[0].note + (f"; {listed(alike)} likewise" if alike else ""))


def _examined(campaign: Campaign) -> tuple[Campaign, tuple[ImplausibleRecord, ...]]:
    campaign, clocks = plausible_clocks(campaign)
    campaign, weather = plausible_weather(campaign)
    campaign, lengths = plausible_lengths(campaign)
    return campaign, (*clocks, *weather, *lengths, *implausible_posture(campaign), *posture_by_ground_prisms(campaign))
