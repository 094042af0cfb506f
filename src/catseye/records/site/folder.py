"""Site: a directory with the layout of a campaign without shots, samples and weather.

A campaign's directory is also a site's; files of its night only are then not read.
"""

import csv
import io
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
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
from catseye.records.site.structural_model import StructuralModel, structural_model_toml
from catseye.records.site.target import BenchmarkRow, FeedArm, TargetRow, Targets
from catseye.records.site.triplet import TripletRecord

T = TypeVar("T")

REFERENCE = "ZRG"  # target name of the ranger's internal cube
STRUCTURAL_MODEL = "structural-model.toml"  # of the site's telescope, if the directory has one


@dataclass(frozen=True, eq=False, repr=False)
class SiteFolder:
    """Content of a site's directory; `hashes` are the SHA-256 of its files by relative path.

    `structure` is the structural model of its telescope; None of a rigid one.
    """

    directory: Path
    site: SiteRecord
    monuments: dict[str, MonumentRecord]
    mirrors: dict[str, Mirror]
    feedarm: FeedArm
    targets: dict[str, TargetRow]
    triplets: dict[str, TripletRecord]
    benchmarks: tuple[BenchmarkRow, ...]
    hashes: dict[str, str]
    structure: StructuralModel | None = field(default=None, kw_only=True)

    def __repr__(self) -> str:
        return (
            f"<Site {self.site.campaign.name}: {len(self.monuments)} rangers on the ground and "
            f"{len(self.feedarm.ranger)} on the feed arm, {len(self.targets)} targets, {len(self.triplets)} triplets, "
            f"{len(self.benchmarks)} benchmarks; from {self.directory.name}/>"
        )

    @property
    def rangers(self) -> tuple[str, ...]:
        """Names of all rangers, on the ground and on the feed arm, sorted."""
        return tuple(sorted(mounts(self.monuments, self.feedarm)))

    @property
    def target_names(self) -> tuple[str, ...]:
        """Names that a shot's target may have, sorted."""
        prisms_and_balls = (name for triplet in self.triplets.values() for name in triplet.targets)
        return tuple(sorted([*self.targets, *prisms_and_balls, *self.rangers, REFERENCE]))

    @property
    def triplet_of(self) -> dict[str, str]:
        """Triplet of each of its targets."""
        return {target: name for name, triplet in self.triplets.items() for target in triplet.targets}

    def mirror_of(self, ranger: str) -> Mirror:
        mounted = mounts(self.monuments, self.feedarm)
        if ranger not in mounted:
            raise InputError(f"ranger = {shown(ranger)} is not in monuments/ or feedarm.toml")
        return self.mirrors[mounted[ranger][0]]


@dataclass(frozen=True)
class SiteRecords:
    """Content of a site's files, file by file, before cross-checks."""

    site: SiteRecord
    monuments: dict[str, MonumentRecord]
    mirrors: dict[str, Mirror]
    feedarm: FeedArm
    targets: tuple[TargetRow, ...]
    triplets: dict[str, TripletRecord]
    benchmarks: list[BenchmarkRow]
    structure: StructuralModel | None = None

    def named(self, folder: Folder) -> dict[str, Any]:
        """Fields of a `SiteFolder`, records by name; `hashes` are those of the files read so far."""
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
            "structure": self.structure,
        }


def read_site(directory: Path | str) -> SiteFolder:
    """Site in the directory (layout: docs/formats/site.md); InputError if invalid.

    directory   of a site or a campaign
    """
    folder = Folder(Path(directory))
    refuse_directory(folder.directory, "site")
    records = read_records(folder)
    site = SiteFolder(**records.named(folder))
    refuse_unjoined(site, records)
    return site


def read_records(folder: Folder) -> SiteRecords:
    """Records of a site's files, each valid on its own."""
    bent = os.path.lexists(folder.directory / STRUCTURAL_MODEL)
    return SiteRecords(
        site=folder.record("site.toml", SiteRecord),
        monuments={file: folder.record(file, MonumentRecord) for file in folder.records_in("monuments")},
        mirrors={file: folder.record(file, Mirror) for file in folder.records_in("mirrors")},
        feedarm=folder.record("feedarm.toml", FeedArm),
        targets=folder.record("targets.toml", Targets).target,
        triplets={file: folder.record(file, TripletRecord) for file in folder.records_in("triplets")},
        benchmarks=folder.table("benchmarks.csv", BenchmarkRow),
        structure=folder.record(STRUCTURAL_MODEL, StructuralModel) if bent else None,
    )


def refuse_unjoined(site: SiteFolder, records: SiteRecords) -> None:
    """Raise InputError for double names, rangers without mirror, or benchmarks without ends."""
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
    """Records by name, which must also be the file's name."""
    for file, (name, _) in records.items():
        if name != Path(file).stem:
            raise refusal(file, f"{key} = {shown(name)} (expected {shown(Path(file).stem)}, as the file's name)")
    return dict(records.values())


def mounts(monuments: dict[str, MonumentRecord], feedarm: FeedArm) -> dict[str, tuple[str, str]]:
    """Name of each ranger's mirror, and the file and place that define it."""
    ground = {name: (monument.zp, f"monuments/{name}.toml: ") for name, monument in monuments.items()}
    arm = {ranger.name: (ranger.zp, f"feedarm.toml: ranger[{ranger.name!r}].") for ranger in feedarm.ranger}
    return ground | arm


def refuse_double_names(site: SiteFolder, targets: Iterable[str]) -> None:
    """Raise InputError for names used twice; a monument's name with -F is its fixed point."""
    files_by_name = {REFERENCE: "the internal reference cube"}
    named = [(name, f"monuments/{name}.toml", "monument") for name in site.monuments]
    named += [(f"{name}-F", f"monuments/{name}.toml", "fixed point") for name in site.monuments]
    named += [(ranger.name, "feedarm.toml", "ranger") for ranger in site.feedarm.ranger]
    named += [(name, "targets.toml", "target") for name in targets]
    for triplet in site.triplets.values():
        named += [(name, f"triplets/{triplet.triplet}.toml", "target") for name in triplet.targets]
    for name, file, key in named:
        if name in files_by_name:
            raise refusal(file, f"{key} = {name!r} is a name taken by {files_by_name[name]} (expected unique names)")
        files_by_name[name] = file


def refuse_mirrors(site: SiteFolder) -> None:
    """Raise InputError unless every ranger has its own mirror."""
    users: dict[str, str] = {}
    for ranger, (zp, place) in mounts(site.monuments, site.feedarm).items():
        file, _, key = place.partition(": ")
        if zp not in site.mirrors:
            raise refusal(file, f"{key}zp = {zp!r} has no calibration (expected a file mirrors/{zp}.toml)")
        if zp in users:
            raise refusal(file, f"{key}zp = {zp!r} is on {users[zp]} already (expected one mirror per ranger)")
        users[zp] = ranger


def refuse_benchmarks(site: SiteFolder) -> None:
    targets, rangers = set(site.target_names) - {REFERENCE}, set(site.rangers)
    for row, benchmark in enumerate(site.benchmarks, start=1):
        refuse_unknown_ends("benchmarks.csv", row, benchmark, targets=targets, rangers=rangers)


class SiteLine(Protocol):
    """Row that joins a ranger to a target."""

    @property
    def ranger(self) -> str: ...
    @property
    def target(self) -> str: ...


def refuse_unknown_ends(file: str, row: int, line: SiteLine, *, targets: set[str], rangers: set[str]) -> None:
    """Raise InputError unless a row's ranger and target are known and different."""
    if line.ranger not in rangers:
        raise in_row(file, row, f"ranger = {shown(line.ranger)} is not in monuments/ or feedarm.toml")
    if line.target not in targets:
        places = "targets.toml, triplets/, monuments/ or feedarm.toml"
        raise in_row(file, row, f"target = {shown(line.target)} is not in {places}")
    if line.target == line.ranger:
        raise in_row(file, row, f"target = {shown(line.target)} is the ranger itself (expected another)")


def site_files(site: SiteFolder) -> dict[str, str]:
    """Files of a site, text by relative path, exact when read back by `read_site`.

    site   or a campaign, without its night
    """
    return {
        "site.toml": record_toml(site.site),
        **{f"monuments/{name}.toml": record_toml(record) for name, record in site.monuments.items()},
        **{f"mirrors/{name}.toml": record_toml(record) for name, record in site.mirrors.items()},
        "feedarm.toml": record_toml(site.feedarm),
        "targets.toml": record_toml(Targets(target=tuple(site.targets.values()))),
        **{f"triplets/{name}.toml": record_toml(record) for name, record in site.triplets.items()},
        "benchmarks.csv": _table_csv(site.benchmarks, BenchmarkRow),
        **({} if site.structure is None else {STRUCTURAL_MODEL: structural_model_toml(site.structure)}),
    }


def _table_csv(rows: Iterable[Record], kind: type[Record]) -> str:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(kind.model_fields), lineterminator="\n")
    writer.writeheader()
    writer.writerows(row.model_dump() for row in rows)
    return text.getvalue()
