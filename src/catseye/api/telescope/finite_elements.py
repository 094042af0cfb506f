"""`import_model`: a finite element result in a structural model."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, SinglePage, quantities
from catseye.api.telescope.displacement import antenna_from
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.structural_model import StructuralModel
    from catseye.reduction.structure.finite_elements import ImportedModel


@dataclass(frozen=True, eq=False, repr=False)
class ModelImportResult(Result):
    """Structural model with a finite element result in it.

    imported   new model, nodes of the targets, rigid part and residual
    hashes     SHA-256 of each file read, by its name
    read       files that were read
    """

    imported: "ImportedModel"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    @property
    def model(self) -> "StructuralModel":
        """Structural model with the result in it."""
        return self.imported.record

    def passages(self) -> "Sequence[Passage]":
        """Nodes, size of the displacements, notes."""
        from catseye.gateways.structure.model.import_objects import import_passages

        return import_passages(self.imported)

    def rows(self) -> list[str]:
        """Lines of a terminal: each target's displacement by each term."""
        from catseye.gateways.structure.model.import_objects import import_lines

        return import_lines(self.imported)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye model import --json`."""
        from catseye.gateways.structure.model.import_objects import import_object

        return import_object(self.imported)

    def tables(self) -> "dict[str, QTable]":
        """`nodes`: a row a target and term."""
        from catseye.gateways.structure.model.tables import NODES

        return {"nodes": quantities(NODES.quantities(self.imported, [column.name for column in NODES.columns]))}

    def figures(self) -> "dict[str, Figure]":
        """Displacement of each target by each term."""
        from catseye.gateways.structure.model.import_objects import import_figure

        return {"targets": import_figure(self.imported)}

    def pages(self) -> dict[str, SinglePage]:
        """`record`: the new structural model."""
        from catseye.records.site.structural_model import MARK, structural_model_toml

        def text(_now: "datetime", _path: Path) -> str:
            return structural_model_toml(self.imported.record)

        return {"record": SinglePage(MARK, text)}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye model import --out`."""
        from catseye.gateways.structure.model.import_objects import write_import

        write_import(self.imported, directory, self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Structural model, result and nodes, as paths."""
        return self.read


@with_units
def import_model(
    model: "str | os.PathLike[str] | StructuralModel",
    result: "str | os.PathLike[str]",
    *,
    nodes: "str | os.PathLike[str]",
    case: Sequence[str] | Mapping[str, str] = (),
    terms: str = "cosE,sinE",
    unit: str | None = None,
    frame: str = "reflector",
    axes: str = "x,y,z",
    origin_m: Annotated[Any, In("m", many=True)] = (0.0, 0.0, 0.0),
    within_m: Annotated[Any, In("m", one=True)] = 0.5,
    u_percent: Annotated[Any, In("percent", one=True)] = 10.0,
) -> ModelImportResult:
    """Read a finite element result, displacements by node, into a structural model.

    model       file of docs/formats/structural-model.md, or its record, whose frames and terms of t and A stay
    result      Nastran punch file (.pch), or CSV of node, dx_mm, dy_mm, dz_mm and case or elevation_deg
    nodes       CSV of node, x_m, y_m, z_m and perhaps target
    case        "CASE=cosE" or another term, or "CASE=30", its elevation in degrees; or a mapping
    terms       functions that the elevations are resolved into
    unit        of a punch file: "m", "mm" or "in"
    frame       body that the result is of
    axes        the frame's x, y, z by the result's axes, such as "-y,x,z"
    origin_m    (3,) of the result's axes in the frame
    within_m    from a target at rest to its node
    u_percent   standard uncertainty of the displacements, the prior of a later `fit_model`

    Raises InputError for what cannot be used, ArgumentError for options.

    >>> place = {"nodes": "finite-elements/nodes.csv", "axes": "-y,x,z", "origin_m": (0.0, 54.839108, -4.99999)}
    >>> bent = import_model("structural-model/telescope.toml", "finite-elements/elevations.csv", **place)
    >>> bent.imported.frames, len(bent.imported.matches)
    (('reflector', 'feed_arm'), 14)
    """
    from catseye.records.files.reading import Folder
    from catseye.records.site.nodal_result import read_nodal_result, read_node_places
    from catseye.reduction.structure.finite_elements import by_terms, imported, matched

    for name, value, high in (("within_m", within_m, 100.0), ("u_percent", u_percent, 1000.0)):
        if not 0.0 < value <= high:
            raise ArgumentError(f"{name} = {value:g} (expected above 0, at most {high:g})", name)
    turn, origin = _turn(axes), np.asarray(origin_m, dtype=float)
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise ArgumentError("origin_m is no place (expected x, y, z in m)", "origin_m")
    antenna, hashes, read = antenna_from(model)
    paths = [place_of(item) for item in (result, nodes)]
    folders = [Folder(path.parent) for path in paths]
    cases = read_nodal_result(folders[0], paths[0].name, unit=unit)
    places = read_node_places(folders[1], paths[1].name)
    functions, values, misfit = by_terms(cases, _cases(case), [term.strip() for term in terms.split(",")])
    matches, missing = matched(antenna, places, frame=frame, turn=turn, origin=origin, within=within_m)
    rows = {node: values[:, i] @ turn.T for i, node in enumerate(cases.nodes)}
    chosen = tuple(match for match in matches if match.node in rows)
    bent = imported(
        antenna,
        chosen,
        (*missing, *(match.target for match in matches if match.node not in rows)),
        frame=frame,
        terms=functions,
        displacement=rows,
        u_share=u_percent / 100.0,
        misfit=misfit,
    )
    for folder in folders:
        hashes = hashes | folder.hashes
    return ModelImportResult(verdict=bent.verdict, imported=bent, hashes=hashes, read=(*read, *paths))


def _turn(axes: str) -> np.ndarray:
    """Rotation (3, 3) to the frame's axes from the result's; ArgumentError for axes that are none."""
    turn = np.zeros((3, 3))
    parts = [part.strip() for part in axes.split(",")]
    for row, part in enumerate(parts[:3]):
        letter = part.removeprefix("-").removeprefix("+")
        if letter in ("x", "y", "z"):
            turn[row, "xyz".index(letter)] = -1.0 if part.startswith("-") else 1.0
    if len(parts) != 3 or not np.isclose(np.linalg.det(turn), 1.0):
        raise ArgumentError(
            f"axes = {axes!r} is no right-handed system (expected x, y, z each once, such as -y,x,z)", "axes"
        )
    return turn


def _cases(case: Any) -> dict[str, str]:
    """Meaning of each case; ArgumentError for a text without one."""
    if isinstance(case, Mapping):
        return {str(name): str(meaning) for name, meaning in case.items()}
    chosen: dict[str, str] = {}
    for each in [case] if isinstance(case, str) else case:
        name, _, meaning = each.partition("=")
        if not name or not meaning or name in chosen:
            raise ArgumentError(f"case = {each!r} (expected CASE=cosE or CASE=30, each case once)", "case")
        chosen[name.strip()] = meaning.strip()
    return chosen
