"""What comes with catseye under examples/: found by name, listed, and copied out."""

import shutil
from pathlib import Path

from catseye.errors import InputError
from catseye.gateways.writers.output import new_directory
from catseye.records.files.refusal import shown

SHORT = {"night-01": "night-01", "gbt": "sites/gbt"}  # names that a user may type without the folder
SITE_NAMES = ("gbt",)
MARK = {"night-01": "site.toml", "gbt": "site.toml"}  # what a folder of one's own of that name must hold to be meant
SKIPPED = {"__pycache__"}


def examples_directory() -> Path:
    """Where the examples are: inside the installed package, or beside the sources; or InputError."""
    package = Path(__file__).parents[1]
    for root in (package, package.parents[1]):
        if (root / "examples" / "night-01").is_dir():
            return root / "examples"
    raise InputError(f"the examples are missing: neither {package / 'examples'} nor {package.parents[1] / 'examples'}")


def example_names() -> tuple[str, ...]:
    """Every example by the name that `example` takes, sorted: files, and folders that are read as one."""
    root = examples_directory()
    wholes = [path.parent for path in root.rglob("site.toml")] + [path.parent for path in root.rglob("points.csv")]
    files = [
        path
        for path in root.rglob("*")
        if path.is_file() and not SKIPPED & set(path.parts) and not any(whole in path.parents for whole in wholes)
    ]
    return tuple(sorted(path.relative_to(root).as_posix() for path in [*wholes, *files]))


def example(name: str) -> Path:
    """Where an example is; InputError for a name that is none.

    name   "night-01", "gbt", or the place under examples/, as networks/feed-arm.toml
    """
    root = examples_directory()
    place = root / SHORT.get(name, name)
    if not name or Path(name).is_absolute() or ".." in Path(name).parts or not place.exists():
        raise InputError(f"example {shown(name)} is not there (expected one of catseye.examples())")
    return place


def example_campaign() -> Path:
    """Where the bundled campaign is."""
    return example("night-01")


def bundled_site(name: str) -> Path:
    """Where a bundled site is; a name that is none of them, or whose files are missing, raises InputError.

    name   one of SITE_NAMES
    """
    if name not in SITE_NAMES:
        raise InputError(f"site = {shown(name)} is not bundled (expected {', '.join(SITE_NAMES)})")
    return example(name)


def located(path: Path | str, *, output: bool = False) -> Path:
    """What a user's path means: the path as it stands, or the example of that name where nothing stands there.

    path     as the user wrote it. A folder of one's own called night-01 or gbt goes before the bundled one where it is
             a site's or a campaign's; what a command wrote under that name does not,
    output   unless what a command wrote is wanted

    >>> located("elsewhere/gbt").as_posix()
    'elsewhere/gbt'
    """
    given, name = Path(path), str(path)
    if name in SHORT and not (output and given.exists()):
        return given if (given / MARK[name]).exists() else example(name)
    if given.exists() or given.is_absolute():
        return given
    try:
        return example(given.as_posix().removeprefix("examples/"))
    except InputError:
        return given


def copy_example(name: str, directory: Path) -> int:
    """Copy a folder of examples, whole or not at all; how many files.

    name        as for `example`, or "" for all
    directory   new or empty

    Raises InputError where it holds something or cannot be written.
    """
    root = example(name) if name else examples_directory()
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        raise InputError(f"{directory}: is there and not empty (expected a new or an empty folder)")
    with new_directory(directory) as fresh:

        def copied(source: str, target: str) -> None:
            try:
                shutil.copy2(source, target)
            except OSError as problem:  # of which copytree would make a list
                place = directory / Path(target).relative_to(fresh)
                raise InputError(f"{place}: cannot be written: {problem.strerror or problem}") from problem

        ignored = shutil.ignore_patterns(*SKIPPED)
        shutil.copytree(root, fresh, ignore=ignored, copy_function=copied, dirs_exist_ok=True)
    return sum(path.is_file() for path in directory.rglob("*"))
