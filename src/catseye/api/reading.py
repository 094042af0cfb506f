"""`load`, `examples` and `topic`: a file or folder by what it holds, and what comes with catseye."""

import os
import tomllib
from dataclasses import replace
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.coordinator.journal.reader import JournalReader
    from catseye.estimation.network.model import ObservationNetwork
    from catseye.records.files.record import Record
    from catseye.records.network.solved_points import SolvedPoints
    from catseye.records.night.campaign import Campaign
    from catseye.records.site.folder import SiteFolder
    from catseye.records.site.structural_model import StructuralModel
    from catseye.records.topics.pages import Topic

    Site = TypeVar("Site", bound=SiteFolder)
    Loaded: TypeAlias = Campaign | SiteFolder | ObservationNetwork | SolvedPoints | Record | JournalReader

DATABASES = ("postgresql://", "postgres://", "sqlite://")
SQLITE = b"SQLite format 3\x00"
EXPECTED = (
    "expected a campaign's or a site's folder, a network (.toml, .dat, .gkf, .xml or a folder with ranges.csv), what "
    "catseye reduce --out wrote, a record (.toml) or a journal"
)


def examples(name: str | None = None, *, directory: "str | os.PathLike[str] | None" = None) -> Any:
    """Path of an example, the names of all, or copies of them.

    name        "night-01", "gbt", or one of the names listed; None for all
    directory   where to copy them, new or empty; None: they stay

    Returns a Path, or a tuple of names; with `directory` a tuple of the files written. Raises InputError for an
    unknown name, and for a directory that is not empty or cannot be written.

    >>> examples("networks/feed-arm.toml").name
    'feed-arm.toml'
    """
    from catseye.records.files.examples import example, example_names

    if directory is not None:
        from catseye.gateways.examples import copy_example

        return copy_example(name or "", Path(directory))
    return example_names() if name is None else example(name)


def topics() -> dict[str, str]:
    """Titles of all pages of the documentation, by name.

    >>> topics()["conventions"]
    'Conventions'
    """
    from catseye.records.topics.pages import topic_titles

    return topic_titles()


def topic(name: str) -> "Topic":
    """Page of the documentation that comes with catseye.

    name   one of `topics()`: "conventions", "formats/beam"; or the last part of one, where it is the only one

    Returns a Topic: `title`, `text` in Markdown, which it is printed as, and the names of `related` topics. Raises
    InputError with near matches for an unknown name.

    >>> topic("network").name
    'formats/network'
    """
    from catseye.records.topics.pages import read_topic

    return read_topic(name)


def structure_of(structure: "str | os.PathLike[str] | StructuralModel") -> "StructuralModel":
    """The structural model itself, read where a path or a name was given."""
    from catseye.records.site.structural_model import StructuralModel, read_structural_model

    return structure if isinstance(structure, StructuralModel) else read_structural_model(place_of(structure))


def with_structure(site: "Site", structure: "str | os.PathLike[str] | StructuralModel | None") -> "Site":
    """Site or campaign whose telescope bends by a structural model; as it is with None."""
    from catseye.records.site.folder import STRUCTURAL_MODEL
    from catseye.records.site.structural_model import structural_model_toml

    if structure is None:
        return site
    model = structure_of(structure)
    digest = sha256(structural_model_toml(model).encode()).hexdigest()
    return replace(site, structure=model, hashes=site.hashes | {STRUCTURAL_MODEL: digest})


def place_of(source: "str | os.PathLike[str]", *, output: bool = False) -> Path:
    """The path that a name means: a path as it stands, or the example of that name.

    output   what a command wrote is wanted, such as an epoch
    """
    from catseye.records.files.examples import located

    return located(Path(source), output=output)


def load(source: "str | os.PathLike[str]") -> "Loaded":
    """A file or a folder, read whole by what it holds, refused in one line when bad.

    source   a path, a bundled name, or a journal's postgresql://USER@HOST/DATABASE

    Returns a Campaign (samples, shots, weather, records), SiteFolder, ObservationNetwork, SolvedPoints (which
    `reduce --out` wrote), a record (`MirrorGeometry`, `MonumentGeometry` and so on), or a JournalReader.
    Raises InputError with the file, the place in it, the value and what was expected.

    >>> len(load("night-01").shots)
    759
    """
    if str(source).startswith(DATABASES):
        return _journal(str(source))
    path = place_of(source)
    if path.is_dir():
        return _folder(path)
    if not path.is_file():
        raise InputError(f"{path}: missing ({EXPECTED})")
    with path.open("rb") as stream:
        if stream.read(len(SQLITE)) == SQLITE:
            return _journal(str(path))
    if path.suffix.lower() == ".json":
        from catseye.records.network.solved_points import read_solved_points

        return read_solved_points(path)
    if path.suffix.lower() == ".toml":
        return _toml(path)
    from catseye.records.network.any_file import READERS, read_network

    if path.suffix.lower() in READERS:
        return read_network(path)
    raise InputError(f"{path}: of a kind that is not known ({EXPECTED})")


def _journal(place: str) -> "JournalReader":
    from catseye.coordinator.journal.reader import JournalReader

    return JournalReader(place)


def _folder(path: Path) -> "Loaded":
    if (path / "shots.csv").exists():
        from catseye.records.night.campaign import read_campaign

        return read_campaign(path)
    if (path / "site.toml").exists():
        from catseye.records.site.folder import read_site

        return read_site(path)
    if (path / "coordinates.json").exists():
        from catseye.records.network.solved_points import read_solved_points

        return read_solved_points(path)
    if (path / "ranges.csv").exists():
        from catseye.records.network.any_file import read_network

        return read_network(path)
    raise InputError(f"{path}: holds none of shots.csv, site.toml, coordinates.json, ranges.csv ({EXPECTED})")


def _toml(path: Path) -> "Loaded":
    """A network or a record, told apart by its `format`, else by the key that names the thing."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        document = {}  # the reader below says what is wrong, and where
    mark = str(document.get("format", ""))
    for kind, (key, reader) in TOML_READERS.items():
        if mark.startswith(f"catseye-{kind}-") or (not mark.startswith("catseye-") and key in document):
            module, name = reader.rsplit(".", 1)
            return _read(path, getattr(import_module(module), name))
    from catseye.records.network.toml import read_network_toml

    return read_network_toml(path)


def _read(path: Path, reader: Any) -> "Loaded":
    """By a function of the path, or as a record of a kind."""
    from catseye.records.files.reading import read_record

    return read_record(path, reader) if isinstance(reader, type) else reader(path)


TOML_READERS = {  # kind in `format` -> key that tells a file without one, and the record or the function that reads it
    "triplet-measurement": ("placement", "catseye.records.laboratory.triplet_measurement.TripletMeasurement"),
    "monument": ("monument", "catseye.records.site.monument.MonumentGeometry"),
    "mirror": ("zp", "catseye.records.site.mirror.MirrorGeometry"),
    "triplet": ("triplet", "catseye.records.site.triplet.TripletRecord"),
    "site": ("campaign", "catseye.records.site.site.SiteRecord"),
    "structural-model": ("mode", "catseye.records.site.structural_model.read_structural_model"),
    "calibration": ("quantity", "catseye.records.laboratory.calibration.CalibrationRecord"),
    "baseline": ("pillars", "catseye.records.laboratory.baseline.Baseline"),
    "panel-instrument": ("gauge", "catseye.records.panels.instrument.PanelInstrument"),
    "design": ("targets", "catseye.records.site.design_layout.DesignLayout"),
    "movement-constraints": (
        "still",
        "catseye.records.network.movement_constraints.MovementConstraints",
    ),
    "keep-out": ("boxes", "catseye.records.site.keep_out.KeepOut"),
    "solids": ("box", "catseye.records.site.solids.read_solids"),
    "beam": ("element", "catseye.records.site.beam.BeamTrain"),
    "pointing": ("terms", "catseye.records.site.pointing_model.PointingModel"),
}
