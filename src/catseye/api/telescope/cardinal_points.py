"""`choose_model`: the targets whose ranges determine a structural model best."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.result import Result, quantities
from catseye.api.telescope.displacement import antenna_from, postures_of, site_from
from catseye.api.telescope.model_fit import free_components
from catseye.api.units import In, with_units
from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.folder import SiteFolder
    from catseye.records.site.structural_model import StructuralModel
    from catseye.reduction.design.cardinal_points import PointChoice


@dataclass(frozen=True, eq=False, repr=False)
class PointChoiceResult(Result):
    """Cardinal points of a structural model.

    choice   points in their order, information, candidates
    hashes   SHA-256 of each file read, by its name
    read     files and folders that were read
    """

    choice: "PointChoice"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cardinal points, in the order of their choice."""
        return self.choice.names

    @property
    def gains(self) -> np.ndarray:
        """Information (c,), nats, of the first point, the first two, and so on."""
        return self.choice.gains

    def passages(self) -> "Sequence[Passage]":
        """Points, their information, notes."""
        from catseye.gateways.structure.model.choice_objects import choice_passages

        return choice_passages(self.choice)

    def rows(self) -> list[str]:
        """Lines of a terminal: points with their information, coefficients with u before and after."""
        from catseye.gateways.structure.model.choice_objects import choice_lines

        return choice_lines(self.choice)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye model choose --json`."""
        from catseye.gateways.structure.model.choice_objects import choice_object

        return choice_object(self.choice)

    def tables(self) -> "dict[str, QTable]":
        """`points`: a row a cardinal point."""
        from catseye.gateways.structure.model.tables import POINTS

        return {"points": quantities(POINTS.quantities(self.choice, [column.name for column in POINTS.columns]))}

    def figures(self) -> "dict[str, Figure]":
        """Information of the points together and by themselves."""
        from catseye.gateways.structure.model.choice_objects import choice_figure

        return {"information": choice_figure(self.choice)}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye model choose --out`."""
        from catseye.gateways.structure.model.choice_objects import write_choice

        write_choice(self.choice, directory, self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files and folders that were read."""
        return self.read


@with_units
def choose_model(
    model: "str | os.PathLike[str] | StructuralModel",
    *,
    site: "str | os.PathLike[str] | SiteFolder",
    count: Annotated[Any, In("", whole=True)],
    points: str | Sequence[str] = (),
    free: Sequence[str] | Mapping[str, Sequence[str]] = (),
    posture_deg: Annotated[Any, In("deg")] = None,
    temperature_c: Annotated[Any, In("deg_C", one=True)] = None,
    u_range_mm: Annotated[Any, In("mm", one=True)] = 0.1,
    u_shift_mm: Annotated[Any, In("mm", one=True)] = 5.0,
    u_turn_arcsec: Annotated[Any, In("arcsec", one=True)] = 20.0,
    progress: Progress | None = None,
) -> PointChoiceResult:
    """Choose the cardinal points: the targets whose ranges determine a structural model's coefficients best.

    model           file of docs/formats/structural-model.md, or its record
    site            whose rangers on the ground measure its targets
    count           number of points
    points          names or patterns to choose from; without, all but the prisms of the dish
    free            as for `fit_model`; without, what the model gives of the frames that carry the points
    posture_deg     (p, 2) azimuth and elevation; without, nine over the sky at three temperatures
    temperature_c   of these postures; the model's reference without
    u_range_mm      of a range; 0.5 ppm of its length is added
    u_shift_mm, u_turn_arcsec   prior of a coefficient without a covariance in the model
    progress        called with (what, done, of how many)

    Raises InputError for a file that cannot be used and targets that no ranger sees, ArgumentError for options,
    ValidityError outside the model's range.

    >>> found = choose_model("structural-model/telescope.toml", site="gbt", count=1, posture_deg=[0, 45],
    ...                      free="feed_arm:turn_x", points="ZEG*")
    >>> found.names
    ('ZEG41040L',)
    """
    from catseye.geometry.antenna.deformation import TelescopePosture
    from catseye.reduction.design.cardinal_points import (
        ChoiceSettings,
        candidates_of,
        chosen_points,
        usual_postures,
    )
    from catseye.reduction.structure.displacement import site_points
    from catseye.reduction.structure.model_fit import default_free

    if count < 1:
        raise ArgumentError(f"count = {count} (expected 1 or more)", "count")
    for name, value in (("u_range_mm", u_range_mm), ("u_shift_mm", u_shift_mm), ("u_turn_arcsec", u_turn_arcsec)):
        if not 0.0 < value <= 1e4:
            raise ArgumentError(f"{name} = {value:g} (expected above 0, at most 10000)", name)
    if posture_deg is None and temperature_c is not None:
        raise ArgumentError(
            "temperature_c needs posture_deg (the nine usual postures have their own)", "temperature_c", "posture_deg"
        )
    components = free_components(free)
    antenna, hashes, read = antenna_from(model)
    records, more = site_from(site)
    if posture_deg is None:
        posture = usual_postures(antenna)
    else:
        angles = postures_of(posture_deg)
        warm = antenna.record.reference_temperature_c if temperature_c is None else float(temperature_c)
        posture = TelescopePosture(angles[:, 0], angles[:, 1], np.full(len(angles), warm))
    patterns = [points] if isinstance(points, str) else list(points)
    targets = [point for point in site_points(antenna, records, patterns)[0] if point.kind == "target"]
    components = components or default_free(antenna, {point.frame for point in targets})
    if not components:
        raise InputError("no motion of the model is free by itself: name a frame and its components")
    settings = ChoiceSettings(
        u_range=u_range_mm * MILLIMETRE, u_shift=u_shift_mm * MILLIMETRE, u_turn=u_turn_arcsec * ARCSECOND
    )
    candidates, hidden = candidates_of(antenna, records, targets, posture, free=components, settings=settings)
    choice = chosen_points(candidates, count, hidden=hidden, progress=progress)
    return PointChoiceResult(verdict=choice.verdict, choice=choice, hashes=hashes | records.hashes, read=(*read, *more))
