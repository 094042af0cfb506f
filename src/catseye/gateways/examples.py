"""The campaign and the sites that come with catseye."""

from pathlib import Path

from catseye.errors import InputError
from catseye.records.files.refusal import shown

NIGHT = Path("examples", "night-01")
SITES = Path("examples", "sites")
SITE_NAMES = ("gbt",)


def example_campaign() -> Path:
    """Where the bundled campaign is: inside the installed package, or beside the sources."""
    return bundled(NIGHT, "the example campaign")


def bundled_site(name: str) -> Path:
    """Where a bundled site is; a name that is none of them, or whose files are missing, raises InputError.

    name   one of SITE_NAMES
    """
    if name not in SITE_NAMES:
        raise InputError(f"site = {shown(name)} is not bundled (expected {', '.join(SITE_NAMES)})")
    return bundled(SITES / name, f"the bundled site {name}")


def site_directory(name: str) -> Path:
    """The directory that a user's SITE means: a bundled site's if it is just its name, else the path as it stands.

    name   as the user wrote it; a folder of one's own called gbt is ./gbt

    >>> site_directory("./gbt").as_posix()
    'gbt'
    """
    return bundled_site(name) if name in SITE_NAMES else Path(name)


def bundled(place: Path, what: str) -> Path:
    """Where something under examples/ is: inside the installed package, or beside the sources; or InputError."""
    package = Path(__file__).parents[1]
    for root in (package, package.parents[1]):
        if (root / place).is_dir():
            return root / place
    raise InputError(f"{what} is missing: neither {package / place} nor {package.parents[1] / place}")
