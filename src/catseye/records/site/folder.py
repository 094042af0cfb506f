"""A site: a directory of what stands there, the layout of a campaign without shots, samples and weather.

A campaign's directory is a site's too; what belongs to its night alone is then not read.
"""

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from catseye.errors import InputError
from catseye.records.files.reading import Folder
from catseye.records.files.record import Record
from catseye.records.files.refusal import in_row, refusal, shown
from catseye.records.files.toml_text import record_toml
from catseye.records.site.mirror import Mirror
from catseye.records.site.monument import MonumentRecord
from catseye.records.site.site import SiteRecord
from catseye.records.site.target import BenchmarkRow, FeedArm, TargetRow, Targets
from catseye.records.site.triplet import TripletRecord

T = TypeVar("T")

REFERENCE = "ZRG"  # as a target: the ranger's internal cube


@dataclass(frozen=True, eq=False, repr=False)
class SiteFolder:
    """Everything that a site's directory holds; `hashes` are the SHA-256 of its files by relative path."""

    directory: Path
    site: SiteRecord
    monuments: dict[str, MonumentRecord]
    mirrors: dict[str, Mirror]
    feedarm: FeedArm
    targets: dict[str, TargetRow]
    triplets: dict[str, TripletRecord]
    benchmarks: tuple[BenchmarkRow, ...]
    hashes: dict[str, str]

    def __repr__(self) -> str:
        return (
            f"<Site {self.site.campaign.name}: {len(self.monuments)} rangers on the ground and "
            f"{len(self.feedarm.ranger)} on the feed arm, {len(self.targets)} targets, {len(self.triplets)} triplets, "
            f"{len(self.benchmarks)} benchmarks; from {self.directory.name}/>"
        )

    @property
    def rangers(self) -> tuple[str, ...]:
        """The names of all rangers, on the ground and on the feed arm, sorted."""
        return tuple(sorted(mounts(self.monuments, self.feedarm)))

    @property
    def target_names(self) -> tuple[str, ...]:
        """Every name that a shot's target may have, sorted."""
        prisms_and_balls = (name for triplet in self.triplets.values() for name in triplet.targets)
        return tuple(sorted([*self.targets, *prisms_and_balls, *self.rangers, REFERENCE]))

    def mirror_of(self, ranger: str) -> Mirror:
        mounted = mounts(self.monuments, self.feedarm)
        if ranger not in mounted:
            raise InputError(f"ranger = {shown(ranger)} is not in monuments/ or feedarm.toml")
        return self.mirrors[mounted[ranger][0]]


@dataclass(frozen=True)
class SiteRecords:
    """What a site's files hold, file by file, not yet held against each other."""

    site: SiteRecord
    monuments: dict[str, MonumentRecord]
    mirrors: dict[str, Mirror]
    feedarm: FeedArm
    targets: tuple[TargetRow, ...]
    triplets: dict[str, TripletRecord]
    benchmarks: list[BenchmarkRow]

    def named(self, folder: Folder) -> dict[str, Any]:
        """The fields of a `SiteFolder`, records by name; `hashes` are those of the files read by now."""
        return {
            "directory": folder.directory,
            "site": self.site,
            "monuments": by_stem(
                "monument", {file: (record.monument, record) for file, record in self.monuments.items()}
            ),
            "mirrors": by_stem("zp", {file: (record.zp, record) for file, record in self.mirrors.items()}),
            "feedarm": self.feedarm,
            "targets": {target.name: target for target in self.targets},
            "triplets": by_stem("triplet", {file: (record.triplet, record) for file, record in self.triplets.items()}),
            "benchmarks": tuple(self.benchmarks),
            "hashes": dict(sorted(folder.hashes.items())),
        }


def read_site(directory: Path | str) -> SiteFolder:
    """The site in the directory (layout: docs/formats/site.md); a bad one raises InputError.

    directory   a site's or a campaign's
    """
    folder = Folder(Path(directory))
    refuse_directory(folder.directory, "site")
    records = read_records(folder)
    site = SiteFolder(**records.named(folder))
    refuse_unjoined(site, records)
    return site


def read_records(folder: Folder) -> SiteRecords:
    """A site's files, each read and each good by itself."""
    return SiteRecords(
        site=folder.record("site.toml", SiteRecord),
        monuments={file: folder.record(file, MonumentRecord) for file in folder.records_in("monuments")},
        mirrors={file: folder.record(file, Mirror) for file in folder.records_in("mirrors")},
        feedarm=folder.record("feedarm.toml", FeedArm),
        targets=folder.record("targets.toml", Targets).target,
        triplets={file: folder.record(file, TripletRecord) for file in folder.records_in("triplets")},
        benchmarks=folder.table("benchmarks.csv", BenchmarkRow),
    )


def refuse_unjoined(site: SiteFolder, records: SiteRecords) -> None:
    """The files agree: each name stands for one thing, each ranger has its mirror, each benchmark its two ends."""
    refuse_double_names(site, [target.name for target in records.targets])
    refuse_mirrors(site)
    refuse_benchmarks(site)


def refuse_directory(directory: Path, kind: str) -> None:
    try:
        if directory.is_dir():
            return
        state = "is not a directory" if directory.exists() else "missing"
    except (OSError, ValueError) as problem:
        state = f"cannot be read: {problem}"
    raise refusal(str(directory), f"{state} (expected a {kind} directory)")


def by_stem(key: str, records: dict[str, tuple[str, T]]) -> dict[str, T]:
    """The records by name, which must be the name of the file too."""
    for file, (name, _) in records.items():
        if name != Path(file).stem:
            raise refusal(file, f"{key} = {shown(name)} (expected {shown(Path(file).stem)}, as the file's name)")
    return dict(records.values())


def mounts(monuments: dict[str, MonumentRecord], feedarm: FeedArm) -> dict[str, tuple[str, str]]:
    """By ranger: its mirror's name, and the file and place that say so."""
    ground = {name: (monument.zp, f"monuments/{name}.toml: ") for name, monument in monuments.items()}
    arm = {ranger.name: (ranger.zp, f"feedarm.toml: ranger[{ranger.name!r}].") for ranger in feedarm.ranger}
    return ground | arm


def refuse_double_names(site: SiteFolder, targets: Iterable[str]) -> None:
    """A name stands for one thing; a monument's name with -F stands for its fixed point."""
    taken = {REFERENCE: "the internal reference cube"}
    named = [(name, f"monuments/{name}.toml", "monument") for name in site.monuments]
    named += [(f"{name}-F", f"monuments/{name}.toml", "fixed point") for name in site.monuments]
    named += [(ranger.name, "feedarm.toml", "ranger") for ranger in site.feedarm.ranger]
    named += [(name, "targets.toml", "target") for name in targets]
    for triplet in site.triplets.values():
        named += [(name, f"triplets/{triplet.triplet}.toml", "target") for name in triplet.targets]
    for name, file, key in named:
        if name in taken:
            raise refusal(file, f"{key} = {name!r} is a name taken by {taken[name]} (expected each name once)")
        taken[name] = file


def refuse_mirrors(site: SiteFolder) -> None:
    """Every ranger has a mirror, and a mirror of its own."""
    users: dict[str, str] = {}
    for ranger, (zp, place) in mounts(site.monuments, site.feedarm).items():
        file, _, key = place.partition(": ")
        if zp not in site.mirrors:
            raise refusal(file, f"{key}zp = {zp!r} has no calibration (expected a file mirrors/{zp}.toml)")
        if zp in users:
            raise refusal(file, f"{key}zp = {zp!r} is on {users[zp]} already (expected a mirror a ranger)")
        users[zp] = ranger


def refuse_benchmarks(site: SiteFolder) -> None:
    known, rangers = set(site.target_names) - {REFERENCE}, set(site.rangers)
    for row, benchmark in enumerate(site.benchmarks, start=1):
        refuse_stranger("benchmarks.csv", row, benchmark, known=known, rangers=rangers)


class SiteLine(Protocol):
    """A row that joins a ranger to a target."""

    @property
    def ranger(self) -> str: ...
    @property
    def target(self) -> str: ...


def refuse_stranger(file: str, row: int, line: SiteLine, *, known: set[str], rangers: set[str]) -> None:
    """A row's ranger and target are known, and two."""
    if line.ranger not in rangers:
        raise in_row(file, row, f"ranger = {shown(line.ranger)} is not in monuments/ or feedarm.toml")
    if line.target not in known:
        places = "targets.toml, triplets/, monuments/ or feedarm.toml"
        raise in_row(file, row, f"target = {shown(line.target)} is not in {places}")
    if line.target == line.ranger:
        raise in_row(file, row, f"target = {shown(line.target)} is the ranger itself (expected another)")


def site_files(site: SiteFolder) -> dict[str, str]:
    """A site as its files, text by relative path, which `read_site` reads back without the loss of a bit.

    site   of a campaign too, whose night is left out
    """
    return {
        "site.toml": record_toml(site.site),
        **{f"monuments/{name}.toml": record_toml(record) for name, record in site.monuments.items()},
        **{f"mirrors/{name}.toml": record_toml(record) for name, record in site.mirrors.items()},
        "feedarm.toml": record_toml(site.feedarm),
        "targets.toml": record_toml(Targets(target=tuple(site.targets.values()))),
        **{f"triplets/{name}.toml": record_toml(record) for name, record in site.triplets.items()},
        "benchmarks.csv": _table_csv(site.benchmarks, BenchmarkRow),
    }


def _table_csv(rows: Iterable[Record], kind: type[Record]) -> str:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(kind.model_fields), lineterminator="\n")
    writer.writeheader()
    writer.writerows(row.model_dump() for row in rows)
    return text.getvalue()
