"""Figure of which ranger sees which retroreflector of a site, as SVG text and in numbers."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import DEGREE
from catseye.gateways.steering.tracking_figures import SIGHTS, visibility_figure
from catseye.gateways.writers.drawing import Svg, svg
from catseye.records.site.folder import read_site
from catseye.records.site.solids import Solids, read_solids
from catseye.reduction.site.places import nominal_frame, places_of
from catseye.reduction.steering.visibility import frames_at, retroreflectors_of, visibility

MOST_NAMED = 20  # retroreflectors with a number of their own


def visibility_plot(
    directory: Path, solids: Path | None, posture: tuple[float | None, ...]
) -> tuple[Svg, dict[str, Any]]:
    """Chart of a site's rangers by retroreflectors, and how many are seen or why not.

    directory   of a campaign or a site
    solids      what stands in the way; None: nothing
    posture     azimuth and elevation, rad; None: the site's

    Raises InputError for an unusable record.
    """
    site = read_site(directory)
    names = ("azimuth_deg", "elevation_deg")
    turned = {name: item / DEGREE for name, item in zip(names, posture, strict=True) if item is not None}
    campaign = site.site.campaign.model_copy(update=turned)
    site = replace(site, site=site.site.model_copy(update={"campaign": campaign}))
    rangers = {name: place.start for name, place in places_of(site).items() if place.kind is None}
    angles = campaign.azimuth_deg * DEGREE, campaign.elevation_deg * DEGREE
    sights = visibility(
        rangers,
        retroreflectors_of(site),
        Solids(format="catseye-solids-1") if solids is None else read_solids(solids),
        frames=frames_at(*angles, reflector=nominal_frame(site)),
    )
    reasons = {label: int(np.sum(sights.code == sight)) for sight, (_, label) in SIGHTS.items()}
    return svg(visibility_figure(sights)), {
        "azimuth_deg": campaign.azimuth_deg,
        "elevation_deg": campaign.elevation_deg,
        "pairs": int(sights.code.size),
        **{label.replace(" ", "_"): count for label, count in reasons.items()},
        "rangers_of_each": {
            target: int(np.sum(sights.seen[:, k])) for k, target in enumerate(sights.targets) if k < MOST_NAMED
        },
        "least_rangers": int(sights.seen.sum(axis=0).min()),
    }
