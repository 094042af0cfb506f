"""Examples bundled with catseye: find and list them."""

from pathlib import Path

from catseye.errors import InputError
from catseye.records.files.refusal import shown

SHORT = {"night-01": "night-01", "gbt": "sites/gbt"}  # short names
MARK = {"night-01": "site.toml", "gbt": "site.toml"}  # file by which a local folder of that name counts as a site
SKIPPED = {"__pycache__"}


def examples_directory() -> Path:
    """Directory of the examples, in the package or beside the sources; InputError if missing."""
    package = Path(__file__).parents[2]
    for root in (package, package.parents[1]):
        if (root / "examples" / "night-01").is_dir():
            return root / "examples"
    raise InputError(f"the examples are missing: neither {package / 'examples'} nor {package.parents[1] / 'examples'}")


def example_names() -> tuple[str, ...]:
    """Names of all examples, sorted; a site or a network folder counts as one."""
    root = examples_directory()
    folders = [path.parent for path in root.rglob("site.toml")] + [
        path.parent for path in root.rglob("points.csv") if (path.parent / "ranges.csv").exists()
    ]
    files = [
        path
        for path in root.rglob("*")
        if path.is_file() and not SKIPPED & set(path.parts) and not any(folder in path.parents for folder in folders)
    ]
    return tuple(sorted(path.relative_to(root).as_posix() for path in [*folders, *files]))


def example(name: str) -> Path:
    """Path of an example; InputError for an unknown name.

    name   "night-01", "gbt", or the path under examples/, such as networks/feed-arm.toml
    """
    root = examples_directory()
    place = root / SHORT.get(name, name)
    if not name or Path(name).is_absolute() or ".." in Path(name).parts or not place.exists():
        raise InputError(f"example {shown(name)} not found (expected one of catseye.examples())")
    return place


def name_of(path: Path) -> str:
    """Path as a person reads it: of an example, the name that the commands take."""
    try:
        root = examples_directory()
    except InputError:
        return str(path)
    return path.relative_to(root).as_posix() if path.is_relative_to(root) and path != root else str(path)


def example_campaign() -> Path:
    """Path of the bundled campaign."""
    return example("night-01")


def located(path: Path | str, *, output: bool = False) -> Path:
    """Path as given, or the bundled example of that name if nothing exists there.

    path     as the user wrote it. A local folder night-01 or gbt takes precedence over the bundled one if it is a site
             or a campaign; a command's output of that name does not,
    output   unless this is True

    >>> located("elsewhere/gbt").as_posix()
    'elsewhere/gbt'
    """
    local, name = Path(path), str(path)
    if name in SHORT and not (output and local.exists()):
        return local if (local / MARK[name]).exists() else example(name)
    if local.exists() or local.is_absolute():
        return local
    try:
        return example(local.as_posix().removeprefix("examples/"))
    except InputError:
        return local
