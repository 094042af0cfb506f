"""`search_scan`: the search for retroreflectors, planned and simulated."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.reading import place_of
from catseye.api.result import SinglePage, digest_of
from catseye.api.scans.tabled import TabledResult
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from catseye.gateways.scans.files import Sources
    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.scans.searches import Searches

MRAD = 1e-3  # rad


@dataclass(frozen=True, eq=False, repr=False)
class SearchesResult(TabledResult):
    """Searches for several targets from one ranger.

    probability   (t,) of finding each target
    counts        (t, 2) found; nan where not
    u             (t, 2) their standard uncertainties
    searches      everything else: plans, spots, truth
    """

    COMMAND = "scan search"
    probability: np.ndarray
    counts: np.ndarray
    u: np.ndarray
    searches: "Searches"

    def passages(self) -> "Sequence[Passage]":
        """The pattern, what to expect of it, and what the simulated search found."""
        from catseye.gateways.scans.search_objects import search_passages

        return search_passages(self.searches)

    def rows(self) -> Iterator[str]:
        """Lines of the terminal: a row a target."""
        from catseye.gateways.scans.search_objects import search_rows

        return search_rows(self.searches)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye scan search --json`."""
        from catseye.gateways.scans.search_objects import searches_object

        return {"verdict": self.verdict.to_object(), **searches_object(self.searches)}

    def _sources(self) -> "Sources":
        from catseye.gateways.scans.search_objects import LOOKS, SEARCHES

        return {SEARCHES: self.searches, LOOKS: self.searches}

    def figures(self) -> "dict[str, Figure]":
        """Probability by time, and the path of each search."""
        from catseye.gateways.scans.search_figures import search_figures

        return search_figures(self.searches)

    def pages(self) -> dict[str, SinglePage]:
        """`readings`: table of the found targets for `catseye calibrate search-results`."""
        from catseye.reduction.scans.searches import READINGS_HEAD

        return {"readings": SinglePage(READINGS_HEAD, lambda when, path: self.searches.readings())}


@with_units
def search_scan(
    targets: "str | os.PathLike[str]",
    *,
    monument: "str | os.PathLike[str]",
    mirror: "str | os.PathLike[str]",
    u_mrad: Annotated[Any, In("mrad", one=True)] = 0.5,
    radius_mrad: Annotated[Any, In("mrad", one=True)] = None,
    pattern: str = "spiral",
    spot_mm: Annotated[Any, In("mm", one=True)] = 40.0,
    look_s: Annotated[Any, In("s", one=True)] = 0.5,
    seed: Annotated[Any, In("", whole=True)] = 1,
) -> SearchesResult:
    """Search for retroreflectors: pattern, probability of finding, time, and a simulated search.

    targets            TARGETS.csv: target, x_m, y_m, z_m in the ground frame
    monument, mirror   records of the ranger's monument, and of the mirror on it
    u_mrad             standard uncertainty of the predicted pointing in azimuth and elevation, mrad
    radius_mrad        of the searched area; three times u_mrad if None
    pattern            "spiral", outwards, or "raster", of a square
    spot_mm            expected radius of the spot at 1/e², mm at the target
    look_s             time of one look, with the move to it, s
    seed               of the simulated ranger: its error of pointing, light and noise

    The simulated ranger's zeros of both encoders are off by draws of u_mrad, the same for all targets.

    Raises InputError for unusable files, ArgumentError for invalid arguments, ValidityError for a spot that whole
    counts miss.

    >>> ranger = {"monument": "night-01/monuments/ZY103.toml", "mirror": "night-01/mirrors/ZP103.toml"}
    >>> result = search_scan("scans/targets.csv", **ranger)
    >>> result.verdict.word, result.probability.min().round(4).item()
    ('good', 0.9992)
    """
    from catseye.records.files.reading import read_record
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.reduction.scans.searches import TargetSearch, read_targets, search_targets
    from catseye.simulator.laboratory.spots import SimulatedRanger

    for name, value in (("u_mrad", u_mrad), ("spot_mm", spot_mm), ("look_s", look_s)):
        if not 0.0 < value < np.inf:
            raise ArgumentError(f"{name} = {value:g} is not above 0", name)
    if radius_mrad is not None and not 0.0 <= radius_mrad <= 100.0:
        raise ArgumentError(f"radius_mrad = {radius_mrad:g} is not 0 to 100", "radius_mrad")
    if pattern != "spiral" and pattern != "raster":
        raise ArgumentError(f"pattern = {pattern!r} (expected spiral or raster)", "pattern")
    if seed < 0:
        raise ArgumentError(f"seed = {seed} is below 0", "seed")
    read = tuple(place_of(item) for item in (targets, monument, mirror))
    places = read_targets(read[0])
    stands, head = read_record(read[1], MonumentGeometry), read_record(read[2], MirrorGeometry)
    zeros = np.array([head.na0, head.ne0], dtype=float)
    ranger = SimulatedRanger.drawn(zeros, u_mrad * MRAD, np.random.default_rng(seed))
    settings = TargetSearch(
        name="spiral" if pattern == "spiral" else "raster",
        spot=spot_mm * 1e-3,
        u=u_mrad * MRAD,
        radius=3.0 * u_mrad * MRAD if radius_mrad is None else radius_mrad * MRAD,
        look=look_s,
    )
    searches = search_targets(places, stands, head, measure=ranger.measure, settings=settings)
    return SearchesResult(
        verdict=searches.verdict,
        probability=np.array([plan.total for plan in searches.plans]),
        counts=np.array([spot.counts for spot in searches.spots]),
        u=np.array([spot.u_counts for spot in searches.spots]),
        searches=searches,
        hashes={str(path): digest_of(path) for path in read},
        read=read,
    )
