"""Positions that do not fit the rest of the site: geographic against ground frame, prisms against the dish.

A length in another unit is off by a factor of 10 or more, which the rest of the site shows without any range.
"""

from dataclasses import replace

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.records.night.campaign import Campaign
from catseye.records.site.target import TargetRow
from catseye.reduction.site.plausible.record import ImplausibleRecord, listed

MERIDIAN_RADIUS_M = 6.3674e6  # mean of the meridian's, 6.335e6 at the equator to 6.400e6 at the pole: GRS 80
USUAL_LATITUDE_M, USUAL_HEIGHT_M = 30.0, 10.0  # chosen: a handheld receiver's place, and the geoid's under a site
STANDS_OUT = 10.0  # times the other monuments' scatter
FEWEST = 4  # monuments of which one can stand out
FAR_NORTH_DEG = 0.5  # chosen: 56 km from the site's latitude to its monuments'
OFF_DISH_M = OFF_ENDS_M = 0.3  # chosen: twenty times the usual error of a typed position, 15 mm
UNITS_MM = {"metres": 1e3, "centimetres": 10.0, "inches": 25.4, "feet": 304.8, "micrometres": 1e-3}
NEAR = 0.01  # relative tolerance of a unit's factor
MANY = 0.5  # share of the dish's prisms beyond which the list or the paraboloid is wrong as a whole


def plausible_lengths(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    """Campaign without shots on implausible targets, and what is implausible."""
    implausible = [*_latitudes(campaign), *_monuments(campaign)]
    for check in (_prisms, _certificates):
        campaign, more = check(campaign)
        implausible += more
    return campaign, implausible


def other_unit(size: float, expected: float, near: float = NEAR) -> str:
    """Unit in which a length in mm was typed, "" for none.

    >>> other_unit(120.0 / 25.4, 120.0), other_unit(100.0, 120.0)
    ('inches', '')
    """
    for unit, factor in UNITS_MM.items():
        if abs(size * factor - expected) < near * expected:
            return unit
    return ""


def _latitudes(campaign: Campaign) -> list[ImplausibleRecord]:
    """Latitudes of the site and its monuments in radians, or far apart."""
    monuments = list(campaign.monuments.values())
    if not monuments:
        return []
    site_latitude = campaign.site.site.latitude_deg
    latitude = np.array([m.latitude_deg for m in monuments])
    north = np.array([m.y_mm for m in monuments]) * MILLIMETRE
    monument_latitude = float(np.median(latitude))
    if abs(site_latitude - monument_latitude) > FAR_NORTH_DEG:
        guess = ""
        if abs(site_latitude - monument_latitude * DEGREE) < 0.01:
            guess = f": looks like radians, {site_latitude / DEGREE:.4f}°"
        elif abs(site_latitude + monument_latitude) < 0.01:
            guess = ": its sign is turned"
        apart_deg = abs(site_latitude - monument_latitude)
        monuments_there = f"{apart_deg:.2g}° from the monuments' {monument_latitude:g}°"
        text = f"{site_latitude:g}° is {monuments_there}{guess}; kept, set it right"
        return [ImplausibleRecord("site.toml: site.latitude_deg", text, "latitude", ("site",))]
    apart, spread = north - north.mean(), float(np.ptp(north))
    by_degree = MERIDIAN_RADIUS_M * DEGREE
    rise = float(apart @ (latitude - latitude.mean())) / max(float(apart @ apart), 1e-9)  # latitude per metre
    if (
        spread > 3.0 * USUAL_LATITUDE_M
        and abs(rise * MERIDIAN_RADIUS_M - 1.0) < 0.2
        and abs(site_latitude) < np.pi / 2.0
    ):
        text = (
            f"{site_latitude:g}° and the monuments' latitudes rise by {spread * rise:.2g} over {spread:.0f} m of y_mm "
            f"(expected {spread / by_degree:.2g}°): looks like radians, {site_latitude / DEGREE:.4f}°; kept, set them "
            "right"
        )
        return [ImplausibleRecord("site.toml: site.latitude_deg", text, "latitude", ("site",))]
    return []


def _monuments(campaign: Campaign) -> list[ImplausibleRecord]:
    """Monuments whose latitude or elevation contradicts their coordinates."""
    monuments = list(campaign.monuments.values())
    if len(monuments) < FEWEST:
        return []
    z0 = campaign.site.site.elevation_of_z0_m
    site_latitude = campaign.site.site.latitude_deg
    by_record = {
        "y_mm": np.array([(m.latitude_deg - site_latitude) * DEGREE * MERIDIAN_RADIUS_M for m in monuments]),
        "z_mm": np.array([m.elevation_m - z0 for m in monuments]),
    }
    implausible = []
    for key, expected in by_record.items():
        typed = np.array([getattr(m, key) for m in monuments]) * MILLIMETRE
        off = typed - expected
        common, usual = float(np.median(off)), USUAL_LATITUDE_M if key == "y_mm" else USUAL_HEIGHT_M
        if key == "z_mm" and abs(common) > usual:
            text = (
                f"{z0:g} m is {abs(common):.0f} m {'below' if common < 0.0 else 'above'} what the monuments' "
                "elevation_m and z_mm give; kept, set it right: it places the weather stations"
            )
            where = "site.toml: site.elevation_of_z0_m"
            implausible.append(ImplausibleRecord(where, text, "elevation", ("site",)))
        scatter = 1.4826 * float(np.median(np.abs(off - common)))
        for k in np.flatnonzero(np.abs(off - common) > max(usual, STANDS_OUT * scatter)):
            unit = other_unit(abs(typed[k]), abs(expected[k] + common), near=0.5 * usual / max(abs(expected[k]), usual))
            guess = f": looks like {unit}" if unit else ""
            which = "latitude_deg" if key == "y_mm" else "elevation_m"
            text = (
                f"{typed[k] / MILLIMETRE:.10g} mm is {abs(off[k] - common):.0f} m from its {which}, the other "
                f"monuments within {max(scatter, 0.1):.2g} m{guess}; kept, see which of the two is wrong"
            )
            name = monuments[k].monument
            implausible.append(ImplausibleRecord(f"monuments/{name}.toml: {key}", text, "monument", (name,)))
    return implausible


def _prisms(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    """Prisms of the dish that are far off its paraboloid."""
    shape = campaign.site.paraboloid
    dish = [t for t in campaign.targets.values() if t.shapes_dish]
    off = {t.name: o for t in dish if abs(o := _off_paraboloid(t, shape.focal_length_mm)) > _limit_m(t)}
    if not off:
        return campaign, []
    if len(off) > MANY * len(dish):
        text = (
            f"{len(off)} of {len(dish)} prisms of the dish are up to {max(map(abs, off.values())):.1f} m off the "
            f"paraboloid of site.toml, focal length {shape.focal_length_mm:g} mm"
            f"{_all_in(dish, shape.focal_length_mm)}; set positions or paraboloid right"
        )
        where = "targets.toml: position_mm"
        return campaign, [ImplausibleRecord(where, text, "position", tuple(off), fatal=True)]
    by_unit: dict[str, list[str]] = {}
    for name in off:
        by_unit.setdefault(_unit_of(campaign.targets[name], shape.focal_length_mm), []).append(name)
    implausible: list[ImplausibleRecord] = []
    reasons: dict[str, str] = {}
    for unit, names in by_unit.items():
        one, largest = len(names) == 1, max(abs(off[name]) for name in names)
        far = f"{names[0]} is" if one else f"{listed(tuple(names))} are up to"
        guess = f": looks like {unit}" if unit else ""
        text = f"{far} {largest:.2g} m off the dish's paraboloid{guess}; {'its' if one else 'their'} shots are left out"
        implausible.append(ImplausibleRecord("targets.toml: position_mm", text, "position", tuple(names)))
        reasons |= dict.fromkeys(names, text)
    shots = zip(campaign.shots.shot, campaign.shots.target, strict=True)
    doubts = {int(s): reasons[t] for s, t in shots if t in reasons}
    return replace(campaign, doubted=dict(campaign.doubted) | doubts), implausible


def _limit_m(target: TargetRow) -> float:
    return max(OFF_DISH_M, 10.0 * (target.u_position_mm or 0.0) * MILLIMETRE)


def _off_paraboloid(target: TargetRow, focal_length_mm: float, factor: float = 1.0) -> float:
    """Distance of a prism along z from the design surface, m."""
    x, y, z = (factor * v for v in target.position_mm)
    return (z - (x * x + y * y) / (4.0 * focal_length_mm)) * MILLIMETRE


def _unit_of(target: TargetRow, focal_length_mm: float) -> str:
    """Unit in which a prism lies on the paraboloid, off its vertex, where any small length does; "" for none."""
    limit = _limit_m(target)
    for unit, factor in UNITS_MM.items():
        depth = factor * target.position_mm[2] * MILLIMETRE
        if abs(_off_paraboloid(target, focal_length_mm, factor)) < limit < abs(depth):
            return unit
    return ""


def _all_in(dish: list[TargetRow], focal_length_mm: float) -> str:
    units = [_unit_of(t, focal_length_mm) for t in dish]
    best = max(set(units), key=units.count)
    return f": looks like {best}" if best and units.count(best) > MANY * len(dish) else ""


def _certificates(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    """Certified distances that are not their ends': in another unit, of another benchmark, or the ends' are wrong."""
    from catseye.reduction.site.places import places_of

    if not campaign.benchmarks:
        return campaign, []
    places, implausible, right = places_of(campaign), [], []
    typed = [float(np.linalg.norm(places[m.ranger].start - places[m.target].start)) for m in campaign.benchmarks]
    for mark, length in zip(campaign.benchmarks, typed, strict=True):
        certified = mark.certified_distance_mm * MILLIMETRE
        unit = other_unit(certified, length)
        ends = zip(campaign.benchmarks, typed, strict=True)
        alike = tuple(m.target for m, own in ends if m is not mark and abs(own - certified) <= OFF_ENDS_M)
        if not unit and abs(certified - length) <= OFF_ENDS_M:
            right.append(mark)
            continue
        guess = f"looks like {unit}" if unit else f"looks like that of {listed(alike)}" if alike else ""
        guess = guess or "typed distance and coordinates disagree, undecided which is wrong"
        text = (
            f"{mark.ranger} - {mark.target} is {mark.certified_distance_mm:g} mm where the coordinates give "
            f"{length / MILLIMETRE:.0f} mm: {guess}; left out"
        )
        implausible.append(
            ImplausibleRecord("benchmarks.csv: certified_distance_mm", text, "certificate", (mark.ranger, mark.target))
        )
    return (replace(campaign, benchmarks=tuple(right)), implausible) if implausible else (campaign, [])
