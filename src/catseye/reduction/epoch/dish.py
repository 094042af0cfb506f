"""Which prisms are on the dish, and what that says of each of them."""

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.observations.kinds import Linear
from catseye.estimation.shapes.paraboloid import fit_paraboloid
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.unknowns import CampaignNetwork
from catseye.reduction.site.places import nominal_frame

FEWEST = 12  # prisms that must agree before they speak of others
WELL_KNOWN = 0.001  # m, largest standard uncertainty of a coordinate of a prism that shapes the dish here
ROUNDS = 5  # of leaving out the prisms that stand out


def dish_prisms(campaign: ObservedSite) -> list[str]:
    """Names of the single prisms of the reflector frame, sorted.

    Source: README of the campaign layout: their reference points lie on the paraboloid when the surface is ideal.
    """
    return sorted(n for n, t in campaign.targets.items() if t.type == "prism" and t.frame == "reflector")


def dish_advice(network: CampaignNetwork, x: np.ndarray, covariance: Covariance) -> list[Linear]:
    """For each dish prism the plane of the dish at its typed place, as an observation that may judge but not shape.

    x            (n,) parameters of an adjustment
    covariance   of the parameters

    The dish is the paraboloid through the well-known prisms without those that stand out, because a prism whose place
    was decided by a foreign return is well known and wrong. Too few of them give no advice.
    """
    layout, campaign, limit = network.layout, network.campaign, network.settings.u_surface
    names = np.array([n for n in dish_prisms(campaign) if n in layout.points])
    if not len(names):
        return []
    columns = np.array([layout.columns(n) for n in names])
    known = np.sqrt(covariance.diagonal()[columns].max(axis=1)) < WELL_KNOWN
    nominal = nominal_frame(campaign)
    focal_length = campaign.site.paraboloid.focal_length_mm * MILLIMETRE
    for _ in range(ROUNDS):
        count = int(known.sum())
        if count < FEWEST:
            return []
        try:
            fit = fit_paraboloid(x[columns[known]], np.zeros((count, 3, 3)), nominal, focal_length=focal_length)
        except EstimationError:
            return []
        off = np.abs(fit.deviation - np.median(fit.deviation))
        agree = off < max(3.0 * 1.4826 * float(np.median(off)), limit)
        if agree.all():
            break
        known[np.flatnonzero(known)[~agree]] = False
    typed = fit.frame.inverse().points([network.places[n].start for n in names])
    slope = typed[:, :2] / (2.0 * focal_length)
    foot = np.column_stack([typed[:, :2], np.sum(typed[:, :2] ** 2, axis=1) / (4.0 * focal_length)])
    normal = np.column_stack([-slope, np.ones(len(names))]) / np.sqrt(1.0 + np.sum(slope**2, axis=1))[:, None]
    normal, foot = fit.frame.directions(normal), fit.frame.points(foot)
    return [
        Linear(f"dish at {name}", np.array([n @ p]), np.array([limit**2]), column, n[None])
        for name, n, p, column in zip(names, normal, foot, columns, strict=True)
    ]
