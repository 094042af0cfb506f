"""The campaign that comes with catseye."""

from pathlib import Path

from catseye.errors import InputError

NIGHT = Path("examples", "night-01")


def example_campaign() -> Path:
    """Where the bundled campaign is: inside the installed package, or beside the sources."""
    package = Path(__file__).parents[1]
    for root in (package, package.parents[1]):
        if (root / NIGHT).is_dir():
            return root / NIGHT
    raise InputError(f"the example campaign is missing: neither {package / NIGHT} nor {package.parents[1] / NIGHT}")
