"""A campaign with other records of its instruments, and which of them differ."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from catseye.errors import InputError
from catseye.records.night.campaign import Campaign, refuse_frequencies
from catseye.records.site.folder import SiteFolder, mounts, refuse_unknown_ends
from catseye.reduction.epoch.prior_names import (
    BENCHMARKS,
    GLASS,
    HEADS,
    LEAKAGE,
    MONUMENTS,
    OFFSETS,
    THERMOMETERS,
    TRIPLET_AXES,
    TRIPLET_BALLS,
    TRIPLET_SPACINGS,
    ZEROS,
)

HEAD_KEYS = {  # name of a prior -> keys of a mirror's sheet that it comes from
    ZEROS: ("d0_mm", "u_d0_mm"),
    LEAKAGE: ("leakage_amplitude_volt", "leakage_phase_rad", "u_leakage_volt", "frequency"),
    OFFSETS: ("dx_mm", "dy_mm", "dz_mm", "u_offset_mm", "beta1_rad", "beta2_rad", "u_beta_rad"),
    HEADS: (
        *("axis_offset_mm", "mirror_offset_mm", "beam_x_mm", "beam_y_mm", "u_axis_mm"),
        *("amplitude_to_phase_rad", "u_amplitude_to_phase_rad"),
        *("cyclic_cosine_mm", "cyclic_sine_mm", "u_cyclic_mm"),
        *("second_pass_cosine_per_volt", "second_pass_sine_per_volt", "u_second_pass_per_volt"),
    ),
}


class _Line(NamedTuple):
    """Ranger and target of a shot."""

    ranger: str
    target: str


def with_records(campaign: Campaign, site: SiteFolder) -> Campaign:
    """Campaign with the records of a site: heads, monuments, triplets, targets, benchmarks, stations, constants.

    Its own are name and start of the campaign, its posture, and all that was measured.

    Raises InputError where shots or weather name what the site has not.
    """
    stations = {station.name for station in campaign.site.weather_station}
    chosen = tuple(station for station in site.site.weather_station if station.name in stations)
    if missing := sorted(stations - {station.name for station in chosen}):
        raise InputError(f"{site.directory}/site.toml: weather_station {missing[0]!r} is missing (the night has it)")
    record = site.site.model_copy(update={"campaign": campaign.site.campaign, "weather_station": chosen})
    renewed = replace(
        campaign,
        site=record,
        monuments=site.monuments,
        mirrors=site.mirrors,
        feedarm=site.feedarm,
        targets=site.targets,
        triplets=site.triplets,
        benchmarks=site.benchmarks,
        hashes=campaign.hashes | site.hashes,
    )
    shots, targets, rangers = campaign.shots, set(renewed.target_names), set(renewed.rangers)
    for row, line in enumerate(map(_Line, shots.ranger, shots.target), start=1):
        try:
            refuse_unknown_ends("shots.csv", row, line, targets=targets, rangers=rangers)
        except InputError as problem:
            raise InputError(f"{site.directory}: these records do not fit the night: {problem}") from problem
    refuse_frequencies(renewed)
    return renewed


def changed_records(old: SiteFolder, new: SiteFolder) -> tuple[str, ...]:
    """Records that differ, by kind and name: "mirror of ZY101", "monument ZY101", "triplet TR1"."""
    kinds = {
        "mirror of": _differing(_heads(old), _heads(new)),
        "monument": _differing(old.monuments, new.monuments),
        "triplet": _differing(old.triplets, new.triplets),
        "target": _differing(old.targets, new.targets),
        "benchmark": _differing(_by_target(old), _by_target(new)),
        "station": _differing(_stations(old), _stations(new)),
    }
    return tuple(f"{kind} {name}" for kind, names in kinds.items() for name in sorted(names))


def calibrated_anew(old: SiteFolder, new: SiteFolder) -> dict[str, set[str]]:
    """Owners of parameters whose calibration differs, by the name of the prior that it gives.

    Of a mirror's sheet each effect counts by itself: a new zero leaves the leakage as it was.
    """
    heads, new_heads = _heads(old), _heads(new)
    triplets = _differing(old.triplets, new.triplets)
    of_triplets = {
        target
        for folder in (old, new)
        for name in triplets & set(folder.triplets)
        for target in (*folder.triplets[name].targets, name)
    }
    return {
        **{group: _differing(_parts(heads, keys), _parts(new_heads, keys)) for group, keys in HEAD_KEYS.items()},
        MONUMENTS: _differing(old.monuments, new.monuments),
        TRIPLET_BALLS: of_triplets,
        TRIPLET_SPACINGS: of_triplets,
        TRIPLET_AXES: of_triplets,
        GLASS: of_triplets | _differing(old.targets, new.targets),
        BENCHMARKS: _differing(_by_target(old), _by_target(new)),
        THERMOMETERS: _differing(_stations(old), _stations(new)),
    }


def _parts(heads: Mapping[str, object], keys: tuple[str, ...]) -> dict[str, tuple[object, ...]]:
    """Values of some keys of each head's sheet."""
    return {name: tuple(getattr(head, key) for key in keys) for name, head in heads.items()}


def _heads(site: SiteFolder) -> dict[str, object]:
    """Mirror's sheet of each ranger."""
    return {ranger: site.mirrors[zp] for ranger, (zp, _) in mounts(site.monuments, site.feedarm).items()}


def _by_target(site: SiteFolder) -> dict[str, object]:
    """Benchmark of each target."""
    return {row.target: row for row in site.benchmarks}


def _stations(site: SiteFolder) -> dict[str, object]:
    return {station.name: station for station in site.site.weather_station}


def _differing(old: Mapping[str, object], new: Mapping[str, object]) -> set[str]:
    """Names whose records differ or are in one only."""
    return {name for name in {*old, *new} if old.get(name) != new.get(name)}
