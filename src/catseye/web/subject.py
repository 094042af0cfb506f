"""Subject of a page: a living site, a journal, or a finished result."""

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fastapi import HTTPException

from catseye.version import __version__
from catseye.web.answers import QueryDesk
from catseye.web.feed import LiveFeed

if TYPE_CHECKING:
    from catseye.api.live.address import PageSettings
    from catseye.api.live.watching import SiteWatch

UNIX_EPOCH, DAY = 40_587.0, 86_400.0  # MJD; s


@dataclass(frozen=True)
class PageSubject:
    """Subject of a page.

    kind       "site", "journal" or "result"
    name       of the site or of the result
    watch      of a site or a journal; None for a result
    report     of a result; None for a site and a journal
    commands   True if it takes commands
    """

    kind: str
    name: str
    watch: "SiteWatch | None" = None
    report: dict[str, Any] | None = None
    commands: bool = False
    desk: QueryDesk = field(default_factory=QueryDesk)
    feed: LiveFeed = field(default_factory=LiveFeed)

    def site(self) -> "SiteWatch":
        """Watch of the site.

        Raises HTTPException 404 for a result.
        """
        if self.watch is None:
            raise HTTPException(404, "this page shows a result, not a site (expected /api/report)")
        return self.watch

    def to_object(self, *, needs_token: bool) -> dict[str, Any]:
        """JSON object of /api/service."""
        return {
            "version": __version__,
            "kind": self.kind,
            "name": self.name,
            "commands": self.commands,
            "history": self.watch is not None and self.watch.history,
            "needs_token": needs_token,
            "now": self.now(),
        }

    def now(self) -> float:
        """Present MJD, by the site's clock if it is known."""
        if self.watch is None:
            return UNIX_EPOCH + time.time() / DAY
        mjd = self.watch.state()["mjd"] if self.kind == "site" else None
        return self.watch.now() if mjd is None else float(mjd)


def subject_of(settings: "PageSettings") -> PageSubject:
    """Subject that the settings name.

    Raises InputError: a site, a journal or a result that cannot be read.
    """
    if settings.kind == "result":
        from catseye.api.exploring import report_of

        assert settings.path is not None
        report = report_of(settings.path)
        return PageSubject(kind="result", name=str(report["title"]), report=report)
    from catseye.api.live.watching import watch_journal, watch_site

    if settings.kind == "journal":
        assert settings.journal is not None
        watch = watch_journal(settings.journal)
    else:
        assert settings.site is not None
        assert settings.coordinator is not None
        watch = watch_site(
            settings.site, coordinator=settings.coordinator, rangers=settings.rangers, journal=settings.journal
        )
    commands = settings.kind == "site" and settings.token is not None
    return PageSubject(kind=settings.kind, name=str(watch.site()["name"]), watch=watch, commands=commands)
