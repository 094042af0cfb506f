"""The page beside a site that is served."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from catseye.api.live.address import PAGE_PORT, Place, page_address, page_words

if TYPE_CHECKING:
    from catseye.service.logs import LiveLog
    from catseye.service.page import PageAddress


class SitePage:
    """The page beside a site: where it listens, and its child.

    subject    settings of the page, without the coordinator
    announce   called once with the page's line; None: it was said before
    """

    def __init__(self, address: "PageAddress", subject: dict[str, Any], announce: Callable[[str], None] | None):
        self.address, self._subject, self._announce = address, subject, announce

    async def keep(self, log: "LiveLog", coordinator: tuple[str, int]) -> None:
        """Run the child and restart it whenever it ends, until cancelled.

        log           of the site
        coordinator   its host and port
        """
        from catseye.service.page import PageChild, reachable

        host, port = coordinator

        def listening(actual: "PageAddress") -> None:
            log.tell("page", "listens", f"browsers connect to {actual.url()}")
            if self._announce is not None:
                self._announce(page_words(actual))

        page = PageChild(
            self.address,
            lambda actual: actual.settings("site", coordinator=(reachable(host), port), **self._subject),
            listening=listening,
            warned=lambda line: log.tell("page", "child", line, "warning"),
        )
        await page.child.keep(patient=True)


def site_page(
    subject: dict[str, Any],
    *,
    host: str | None,
    port: int | None,
    certificate: Place,
    key: Place,
    token_file: Place,
    names: Sequence[str],
    announce: Callable[[str], None],
    at_once: bool,
) -> SitePage | None:
    """Page beside a site; None without the packages that it needs, which is announced.

    subject    "site", "journal" and "rangers" by name with their addresses
    port       None for the usual one
    at_once    True to announce the page before it listens: afterwards a screen leaves no place for a line

    Raises ArgumentError and InputError as `page_address`.
    """
    from catseye.service.page import EXTRA, missing_packages

    address = page_address(
        host,
        PAGE_PORT if port is None else port,
        certificate=certificate,
        key=key,
        token_file=token_file,
        names=names,
        commanding=True,
    )
    if missing := missing_packages():
        announce(f"no page: {', '.join(missing)} not installed ({EXTRA})")
        return None
    at_once = at_once and address.port != 0
    if at_once:
        announce(page_words(address))
    rangers = {name: (each.host, each.ports[1]) for name, each in subject["rangers"].items()}
    return SitePage(address, {**subject, "rangers": rangers}, None if at_once else announce)
