"""Prisms on the dish, and the prior that the dish gives each."""

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError
from catseye.estimation.least_squares.covariance import Covariance
from catseye.estimation.observations.kinds import Linear
from catseye.estimation.shapes.paraboloid import fit_paraboloid
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.unknowns import CampaignNetwork
from catseye.reduction.site.places import nominal_frame

FEWEST = 12  # prisms that must agree before they predict others
LARGEST_U = 0.001  # m, largest standard uncertainty of a coordinate of a prism that shapes the dish here
ROUNDS = 5  # of removing outlying prisms


def dish_prisms(campaign: ObservedSite) -> list[str]:
    """Names of the single prisms of the reflector frame, sorted.

    Source: README of the campaign layout: their reference points lie on the paraboloid when the surface is ideal.
    """
    return sorted(n for n, t in campaign.targets.items() if t.shapes_dish)


def dish_prior(network: CampaignNetwork, x: np.ndarray, covariance: Covariance) -> list[Linear]:
    """Plane of the dish at each prism, as a prior.

    It may judge shots but not shape the result.

    x            (n,) parameters of an adjustment
    covariance   of the parameters

    The dish is the paraboloid through the well-known prisms without outliers, because a prism whose place was
    decided by a stray reflection is precise and wrong. Too few of them give no prior.
    """
    layout, campaign, limit = network.layout, network.campaign, network.settings.u_surface
    names = np.array([n for n in dish_prisms(campaign) if n in layout.points])
    if not len(names):
        return []
    columns = np.array([layout.columns(n) for n in names])
    well_determined = np.sqrt(covariance.diagonal()[columns].max(axis=1)) < LARGEST_U
    nominal = nominal_frame(campaign)
    focal_length = campaign.site.paraboloid.focal_length_mm * MILLIMETRE
    for _ in range(ROUNDS):
        count = int(well_determined.sum())
        if count < FEWEST:
            return []
        try:
            fit = fit_paraboloid(
                x[columns[well_determined]], np.zeros((count, 3, 3)), nominal, focal_length=focal_length
            )
        except EstimationError:
            return []
        off = np.abs(fit.deviation - np.median(fit.deviation))
        agree = off < max(3.0 * 1.4826 * float(np.median(off)), limit)
        if agree.all():
            break
        well_determined[np.flatnonzero(well_determined)[~agree]] = False
    typed = fit.frame.inverse().points([network.places[n].start for n in names])
    slope = typed[:, :2] / (2.0 * focal_length)
    foot = np.column_stack([typed[:, :2], np.sum(typed[:, :2] ** 2, axis=1) / (4.0 * focal_length)])
    normal = np.column_stack([-slope, np.ones(len(names))]) / np.sqrt(1.0 + np.sum(slope**2, axis=1))[:, None]
    normal, foot = fit.frame.directions(normal), fit.frame.points(foot)
    return [
        Linear(f"dish at {name}", np.array([n @ p]), np.array([limit**2]), column, n[None])
        for name, n, p, column in zip(names, normal, foot, columns, strict=True)
    ]
