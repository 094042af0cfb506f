"""Kinds of a site's points, in words."""

from collections.abc import Iterable, Mapping

from catseye.records.site.folder import SiteFolder
from catseye.reduction.site.places import RangedPoint


def point_kinds(site: SiteFolder, names: Iterable[str], places: Mapping[str, RangedPoint]) -> dict[str, str]:
    """Kind of each point, in a word or two, in the names' order.

    places   of `reduction.site.places.places_of`; a name without one is a monument's fixed point
    """
    at_triplets = {target for triplet in site.triplets.values() for target in triplet.targets}
    at_benchmarks = {benchmark.target for benchmark in site.benchmarks}

    def kind(name: str) -> str:
        if name not in places:
            return "fixed point"
        if name in site.monuments:
            return "ground ranger"
        retroreflector = places[name].kind
        if retroreflector is None:
            return "feed-arm ranger"
        if name in at_triplets:
            return f"triplet {retroreflector.name}"
        if name in at_benchmarks:
            return "benchmark"
        return "dish prism" if retroreflector.shapes_dish else "structure"

    return {name: kind(name) for name in names}
