"""What we know, as frozen records read from files: `read_campaign` for a directory, `read_record` for one file."""

from catseye.records.files.reading import read_record
from catseye.records.night.campaign import Campaign, read_campaign

__all__ = ["Campaign", "read_campaign", "read_record"]
