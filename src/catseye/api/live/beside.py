"""The page beside a site that is served."""

import asyncio
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from catseye.api.live.address import PAGE_PORT, Place, page_address, page_words

if TYPE_CHECKING:
    from catseye.service.coordinator import Orders, Peers
    from catseye.service.logs import LiveLog
    from catseye.service.page import PageAddress, PageSettings
    from catseye.service.serving import Beside


class SitePage:
    """The page beside a site: where it listens, and its child.

    announce   called once with the page's line; None: it was said before
    """

    def __init__(self, address: "PageAddress", announce: Callable[[str], None] | None):
        self.address, self._announce = address, announce

    def children(self, site: str, orders: "Orders", peers: "Peers") -> "Beside":
        """Coroutine function that runs the page's process beside a coordinator and restarts it whenever it ends.

        site   folder, or bundled name
        """
        from catseye.service.page import PageChild, reachable

        rangers = {name: (each.host, each.ports[1]) for name, each in peers.rangers.items()}  # the first is taken

        async def keep(log: "LiveLog", own_port: "asyncio.Future[int]") -> None:
            port = await own_port

            def settings(actual: "PageAddress") -> "PageSettings":
                at = (reachable(orders.host), port)
                return actual.settings("site", coordinator=at, site=site, journal=orders.journal, rangers=rangers)

            def listening(actual: "PageAddress") -> None:
                log.tell("page", "listens", f"browsers connect to {actual.url()}")
                if self._announce is not None:
                    self._announce(page_words(actual))

            page = PageChild(
                self.address,
                settings,
                listening=listening,
                warned=lambda line: log.tell("page", "child", line, "warning"),
            )
            await page.child.keep(patient=True)

        return keep


def site_page(
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
    return SitePage(address, None if at_once else announce)
