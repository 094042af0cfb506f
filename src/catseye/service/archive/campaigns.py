"""A campaign into an archive."""

from pathlib import Path
from typing import Any

from catseye.errors import CatseyeError
from catseye.names import NOTES_AIR_MODEL
from catseye.records.archive.index import ArchivedNight


def archive_campaign(directory: str, source: str) -> dict[str, Any]:
    """Summary of a campaign's night, after it is in an archive; one that is there already stays as it is.

    A damaged one is written again. A night that cannot be reduced is archived with the reason, samples and inputs.

    Raises InputError for a campaign that cannot be read, or a full disk.
    """
    from catseye.gateways.archive.inputs import night_inputs
    from catseye.gateways.archive.night import night_content
    from catseye.gateways.archive.writer import write_night
    from catseye.records.archive.index import inputs_hash, night_identifier
    from catseye.records.archive.reading import intact_night
    from catseye.records.night.campaign import read_campaign
    from catseye.reduction.epoch.epoch import reduce_epoch
    from catseye.reduction.epoch.settings import ReductionSettings

    archive, folder = Path(directory), Path(source)
    campaign = read_campaign(folder)
    sha256 = inputs_hash(campaign.hashes)
    night = night_identifier(campaign.site.campaign.name, sha256)
    if (present := intact_night(archive, night)) is not None:
        return summary(present, added=False)
    try:
        reduction: Any = reduce_epoch(campaign, ReductionSettings(air_model=NOTES_AIR_MODEL))
    except CatseyeError as problem:
        reduction = str(problem)
    inputs = night_inputs(night, sha256, folder)
    content = night_content(campaign, reduction, inputs=inputs, air_model=NOTES_AIR_MODEL)
    return summary(write_night(archive, content), added=True, row=content.tables["nights"])


def summary(entry: ArchivedNight, *, added: bool, row: Any = None) -> dict[str, Any]:
    """Night, as an outcome has it; with the verdict on it and its sizes where it was added."""
    text = {"night": entry.night, "added": added, "archived_bytes": sum(file.size for file in entry.files)}
    if row is None:
        return text
    numbers = {name: int(row[name][0]) for name in ("points", "shots", "raw_bytes") if name in row}
    verdict = {"word": str(row["verdict"][0]), "why": str(row["why"][0])}
    digest = str(row["digest"][0]) if "digest" in row else ""
    return {**text, **numbers, "digest": digest, "result": verdict}
