"""What we know, as frozen records read from files: `read_campaign` for a directory, `read_record` for one file."""

from catseye.records.campaign import Campaign, read_campaign
from catseye.records.reading import read_record

__all__ = ["Campaign", "read_campaign", "read_record"]
