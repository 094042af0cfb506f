"""`watch_site` and `watch_journal`: a site as people see it, live and from its journal."""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catseye.records.site.folder import SiteFolder
    from catseye.service.watch.watch import SiteWatch as SiteWatch

Address = tuple[str, int]


def watch_site(
    site: "str | os.PathLike[str] | SiteFolder",
    *,
    coordinator: Address,
    rangers: Mapping[str, Address] | None = None,
    journal: "str | os.PathLike[str] | None" = None,
) -> "SiteWatch":
    """Watch of a living site: its state from the coordinator's port, its history from the journal.

    site          a site's folder, its bundled name, or what `load` returned
    coordinator   host and port
    rangers       host and port of each ranger, for its console
    journal       place of the coordinator's journal; None: the last hour, in memory

    Key and TLS of the ports come from the environment, as for every client. Nothing is connected before `run`.

    Raises InputError for records or an environment that cannot be used.
    """
    from catseye.api.live.serving import read_site_of
    from catseye.ranger.door import key_of
    from catseye.ranger.network import Sockets, TlsFiles
    from catseye.records.site.folder import SiteFolder
    from catseye.service.watch.watch import SiteWatch

    return SiteWatch(
        site if isinstance(site, SiteFolder) else read_site_of(site),
        coordinator=coordinator,
        rangers=rangers,
        journal=None if journal is None else str(journal),
        network=Sockets(TlsFiles.of()),
        key=key_of(),
    )


def watch_journal(journal: "str | os.PathLike[str]") -> "SiteWatch":
    """Watch of a journal, also while it is written: any time in it.

    journal   file, or postgresql://USER@HOST/DATABASE

    Raises InputError: no such journal, or one without a run.
    """
    from catseye.service.watch.watch import SiteWatch

    return SiteWatch(None, journal=str(journal))
