"""addresses.toml: network addresses of a site's rangers and feed.

format = "catseye-addresses-1"
feed = "10.1.0.2:5250"                                # optional

[[ranger]]
name = "ZY101"
host = "10.1.8.1"
ports = [5240, 5241]                                  # default
"""

from pathlib import Path

from catseye.coordinator.link.settings import Address
from catseye.ranger.server import PORTS
from catseye.records.files.reading import Folder, toml_of
from catseye.records.files.refusal import refusal, shown
from catseye.records.files.toml_fields import Fields
from catseye.records.site.folder import SiteFolder

FORMAT = "catseye-addresses-1"
LAST_PORT = 65_535


def read_addresses(path: Path, site: SiteFolder) -> tuple[dict[str, Address], tuple[str, int] | None]:
    """Addresses by ranger, and the feed's.

    A ranger of the site without an address does not belong to this coordinator.

    Raises InputError with file, place, value and expected value.
    """
    name = path.name
    values = toml_of(Folder(path.parent).text(name), name)
    top = Fields(name, "top", values)
    if top.text("format") != FORMAT:
        raise refusal(name, f"format = {shown(values['format'])} (expected {FORMAT!r})")
    addresses: dict[str, Address] = {}
    for table in top.tables("ranger"):
        ranger = table.text("name")
        if ranger not in site.rangers:
            raise table.refuse(
                f"name = {shown(ranger)} is not a ranger of the site (expected {', '.join(site.rangers)})"
            )
        if ranger in addresses:
            raise table.refuse(f"name = {shown(ranger)} is listed twice (expected once)")
        addresses[ranger] = Address(table.text("host"), _ports(table))
    if not addresses:
        raise refusal(name, "names no ranger (expected [[ranger]] with name and host)")
    return addresses, None if not top.has("feed") else _feed(top)


def _ports(table: Fields) -> tuple[int, int]:
    value = table.take("ports", list, "two ports", list(PORTS))
    if len(value) != 2 or not all(isinstance(v, int) and 1 <= v <= LAST_PORT for v in value):
        raise table.refuse(f"ports = {shown(value)} (expected two, 1 to {LAST_PORT})")
    return value[0], value[1]


def _feed(top: Fields) -> tuple[str, int]:
    text = top.text("feed")
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 1 <= int(port) <= LAST_PORT:
        raise top.refuse(f"feed = {shown(text)} (expected HOST:PORT)")
    return host.strip("[]"), int(port)
