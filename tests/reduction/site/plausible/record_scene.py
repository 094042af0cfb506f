"""Records of a campaign as the examination judges them, before anything is left out or refused."""

from catseye.reduction.site.plausible.campaign import _examined


def implausible_records(campaign):
    """Records that a reduction leaves out, or refuses."""
    return _examined(campaign)[1]
