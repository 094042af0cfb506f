"""`fit_model`: coefficients of a structural model from measured epochs."""

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
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.network.solved_points import SolvedPoints
    from catseye.records.site.structural_model import StructuralModel
    from catseye.reduction.structure.model_fit import ModelFindings

    Source = str | os.PathLike[str] | SolvedPoints


@dataclass(frozen=True, eq=False, repr=False)
class ModelFitResult(Result):
    """Structural model fitted to epochs: k free coefficients.

    findings    coefficients before and after, covariance, residuals
    hashes   SHA-256 of each file read, by its name
    read     files and folders that were read
    """

    findings: "ModelFindings"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Frame, component and function of the k coefficients."""
        return tuple(f"{row.owner} {row.component} {row.function}" for row in self.findings.coefficients)

    @property
    def coefficients(self) -> np.ndarray:
        """Fitted coefficients (k,), m and rad."""
        return np.array([row.after for row in self.findings.coefficients])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (k, k) of them."""
        return self.findings.fit.covariance

    @property
    def model(self) -> "StructuralModel":
        """Model with the fitted coefficients and their covariance."""
        from datetime import UTC, datetime

        return self.findings.updated(datetime.now(UTC).date())

    def passages(self) -> "Sequence[Passage]":
        """The epochs, the residuals, the largest change, notes."""
        from catseye.gateways.structure.model.fit_objects import fit_passages

        return fit_passages(self.findings)

    def rows(self) -> list[str]:
        """Lines of a terminal: each coefficient before and after, with u."""
        from catseye.gateways.structure.model.fit_objects import fit_lines

        return fit_lines(self.findings)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye model fit --json`."""
        from catseye.gateways.structure.model.fit_objects import fit_object

        return fit_object(self.findings)

    def tables(self) -> "dict[str, QTable]":
        """`coefficients`: a row a coefficient, mm or arc seconds; `residuals`: a row an epoch and target."""
        from catseye.gateways.structure.model.tables import COEFFICIENTS, RESIDUALS, EpochRows

        names = [column.name for column in COEFFICIENTS.columns]
        rows, columns = EpochRows(self.findings), [column.name for column in RESIDUALS.columns]
        return {
            "coefficients": quantities(COEFFICIENTS.quantities(self.findings.coefficients, names)),
            "residuals": quantities(RESIDUALS.quantities(rows, columns)),
        }

    def figures(self) -> "dict[str, Figure]":
        """Changes of the coefficients, and residuals with elevation."""
        from catseye.gateways.structure.model.figures import coefficient_figure, epoch_figure

        return {"coefficients": coefficient_figure(self.findings), "residuals": epoch_figure(self.findings)}

    def pages(self) -> dict[str, SinglePage]:
        """`record`: the new structural model."""
        from catseye.records.site.structural_model import MARK, structural_model_toml

        def text(now: "datetime", _path: Path) -> str:
            return structural_model_toml(self.findings.updated(now.date()))

        return {"record": SinglePage(MARK, text)}

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.structure.model.files import model_fit_report

        return model_fit_report(self.findings, when, self.hashes)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye model fit --out`."""
        from catseye.gateways.structure.model.files import write_model_fit

        write_model_fit(self.findings, directory, self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files and folders that were read."""
        return self.read


@with_units
def fit_model(
    model: "str | os.PathLike[str] | StructuralModel",
    epochs: "Source | Sequence[Source]",
    *,
    free: Sequence[str] | Mapping[str, Sequence[str]] = (),
    temperature_c: Annotated[Any, In("deg_C", one=True)] = None,
) -> ModelFitResult:
    """Fit the coefficients of a structural model to targets measured in many postures, with covariance.

    model           file of docs/formats/structural-model.md, or its record
    epochs          list of epochs (CSV, docs/formats/structure.md), or outputs of `reduce`, or several of them
    free            "FRAME:component,component" such as "feed_arm:turn_x", or a mapping; without, the components that
                    the file gives, of every motion by terms whose own points were measured
    temperature_c   of the structure, in epochs that do not say it

    Raises InputError for what cannot be used, EstimationError for coefficients that the epochs do not determine,
    ValidityError for an epoch outside the model's range, ArgumentError for a free component that is none.

    >>> fit = fit_model("structural-model/telescope.toml", "structure/epochs.csv", free="alidade:turn_x,turn_y")
    >>> len(fit.coefficients), fit.names[0]
    (6, 'alidade turn_x sinA')
    """
    from catseye.records.network.solved_points import SolvedPoints
    from catseye.reduction.structure.epochs import TABLE, read_epochs
    from catseye.reduction.structure.model_fit import model_fit

    chosen = free_components(free)
    antenna, hashes, read = antenna_from(model)
    several = [epochs] if isinstance(epochs, str | os.PathLike | SolvedPoints) else list(epochs)
    places = [item if isinstance(item, SolvedPoints) else place_of(item, output=True) for item in several]
    lists = [item for item in places if isinstance(item, Path) and item.suffix.lower() == TABLE]
    if len(lists) > 1:
        raise ArgumentError(f"epochs has {len(lists)} lists (expected one, and any number of reductions)", "epochs")
    measured = read_epochs([item for item in places if item not in lists], lists[0] if lists else None)
    findings = model_fit(antenna, measured, free=chosen, temperature_c=temperature_c)
    return ModelFitResult(
        verdict=findings.verdict,
        findings=findings,
        hashes=hashes | measured.inputs,
        read=(*read, *(item for item in places if isinstance(item, Path))),
    )


def free_components(free: Any) -> dict[str, tuple[str, ...]]:
    """Components by frame; ArgumentError for a text that names none.

    free   "FRAME:component,component", several of them, or a mapping
    """
    if isinstance(free, Mapping):
        return {name: tuple(components) for name, components in free.items()}
    chosen: dict[str, tuple[str, ...]] = {}
    for text in [free] if isinstance(free, str) else free:
        name, _, components = text.partition(":")
        parts = tuple(part.strip() for part in components.split(",") if part.strip())
        if not name or not parts:
            raise ArgumentError(f"free = {text!r} names no component (expected FRAME:turn_x,shift_y)", "free")
        chosen[name] = (*chosen.get(name, ()), *parts)
    return chosen
