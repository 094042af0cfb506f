"""`reduce` and `night`: samples to coordinates, and a simulated night."""

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of, structure_of, with_structure
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE
from catseye.names import NOTES_AIR_MODEL

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.night.campaign import Campaign
    from catseye.records.site.structural_model import StructuralModel
    from catseye.reduction.epoch.contradictions.contradiction import ClassScatter, Contradiction
    from catseye.reduction.epoch.epoch import Reduction
    from catseye.reduction.epoch.surface import DishPose
    from catseye.simulator.night.night import Night


@dataclass(frozen=True, eq=False, repr=False)
class NightResult(Result):
    """A night reduced: n points in the ground frame (x east, y north, z up; m).

    names                of the points
    x                    (n, 3) m
    u                    (n, 3) m, standard uncertainties
    shots                (n,) int, used shots that each point had part in
    variance_factor      [pvv] / degrees of freedom, expectation 1
    degrees_of_freedom   of the adjustment
    rejected             shot id -> reason; reference shots included
    refractivity_ppm     mean group refractivity over the used paths
    pose                 the dish against its nominal posture as `--json` has it; None where it was not seen
    notes                what a person should know, one line each
    reduction            everything else: phases, ranges, electronics, surface
    """

    names: tuple[str, ...]
    x: np.ndarray
    u: np.ndarray
    shots: np.ndarray
    variance_factor: float
    degrees_of_freedom: float
    rejected: dict[int, str]
    refractivity_ppm: float
    pose: "DishPose | None"
    notes: tuple[str, ...]
    reduction: "Reduction"

    @property
    def covariance(self) -> np.ndarray:
        """(3n, 3n) m², x, y, z of each point in turn; of two thousand points it takes seconds and 0.4 GB."""
        return self.reduction.coordinates.covariance

    @property
    def records(self) -> "QTable":
        """Test of every number of every record: its error, u and w, in the unit beside them."""
        return self.to_table("records")

    @property
    def contradictions(self) -> "tuple[Contradiction, ...]":
        """Contradictions between records and ranges; `text` has each with the records that could be wrong."""
        return self.reduction.coordinates.contradictions

    @property
    def scatter(self) -> "tuple[ClassScatter, ...]":
        """Scatter of the shots of each class of points, against their claim."""
        return self.reduction.coordinates.scatter

    @property
    def lines(self) -> np.ndarray:
        """(n,) int, independent lines to or from each point."""
        return self.reduction.coordinates.lines

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Points that an error of one line or survey could move unseen."""
        return self.reduction.coordinates.unchecked

    @property
    def unmeasured(self) -> tuple[str, ...]:
        """Targets and rangers without a usable shot, which have no coordinates."""
        return self.reduction.coordinates.unmeasured

    def held(self) -> "NightResult":
        """The same without the adjustment's own matrices, which take most of the memory of a large night.

        The covariance of all points stays.
        """
        from catseye.memory import give_back
        from catseye.processors import free_threads

        with free_threads():
            reduction = self.reduction.held()
        give_back()
        return replace(self, reduction=reduction)

    def feed_arm(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Name, coordinates (3,) m and standard uncertainties (3,) mm of each ranger of the feed arm."""
        from catseye.gateways.epoch.summary import feed_arm_rows

        return feed_arm_rows(self.reduction)

    def passages(self) -> "Sequence[Passage]":
        """The night, the shots, the feed arm, the dish, the air, the records, and how far to trust it all."""
        from catseye.gateways.epoch.summary import passages

        return passages(self.reduction)

    def headline(self) -> "Sequence[Passage]":
        """The passages on the night and on the feed arm; with contradictions, on the records too."""
        titles = ("The night", "The feed arm", *(("The records",) if self.contradictions else ()))
        return [p for p in self.passages() if p.title in titles]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye reduce --json`."""
        from catseye.gateways.epoch.objects import reduction_object

        return reduction_object(self.reduction)

    def tables(self) -> "dict[str, QTable]":
        """`points`, `ranges` adjusted, `surface` of the dish, `structure` with a model, `records`, `contradictions`."""
        from catseye.gateways.epoch.record_tests import CONTRADICTIONS, RECORDS, explanation_rows, listed_tests
        from catseye.gateways.epoch.tables import RANGES, SURFACE, PointRows, PrismRows, ShotRows, kinds_of
        from catseye.gateways.epoch.third_order import STRUCTURE

        own = self.reduction.coordinates.joint.blocks
        points = {
            "point": (self.names, ""),
            "kind": (list(kinds_of(self.reduction).values()), ""),
            **{axis: (self.x[:, k], "m") for k, axis in enumerate("xyz")},
            **{f"u_{axis}": (self.u[:, k] / MILLIMETRE, "mm") for k, axis in enumerate("xyz")},
            "covariance": (own / MILLIMETRE**2, "mm2"),
            "shots": (self.shots, ""),
            "lines": (self.lines, ""),
            "status": (PointRows(self.reduction).status, ""),
        }
        ranges = self.reduction.coordinates.ranges
        names = ("shot", "ranger", "target", "range_m", "u_range_mm", "residual_mm", "standardised")
        shots = RANGES.quantities(ShotRows(self.reduction), names, rows=ranges.shot) | {"used": (ranges.used, "")}
        tables = {"points": quantities(points, frame="ground"), "ranges": quantities(shots)}
        surface = self.reduction.surface
        if surface is not None:
            of_prisms = ("point", "deviation_mm", "u_deviation_mm")
            tables["surface"] = quantities(SURFACE.quantities(PrismRows(self.reduction, surface), of_prisms))
        if self.reduction.third_order is not None:
            heads = [column.name for column in STRUCTURE.columns]
            tables["structure"] = quantities(STRUCTURE.quantities(self.reduction.third_order, heads), frame="ground")
        coordinates = self.reduction.coordinates
        tables["records"] = quantities(RECORDS.quantities(listed_tests(coordinates), [c.name for c in RECORDS.columns]))
        explanations = explanation_rows(coordinates.contradictions)
        titles = [c.name for c in CONTRADICTIONS.columns]
        tables["contradictions"] = quantities(CONTRADICTIONS.quantities(explanations, titles))
        return tables

    def figures(self) -> "dict[str, Figure]":
        """The figures of the report: plan, elevation, feed arm, records, residuals, zeros, air, dish."""
        from catseye.gateways.epoch.figures import figures

        return figures(self.reduction)

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.epoch.report import reduction_report

        return reduction_report(self.reduction.held(), when)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye reduce --out`."""
        from catseye.gateways.epoch.files import write_reduction

        write_reduction(self.reduction, directory, progress)

    def sources(self) -> tuple[Path, ...]:
        """Directory of the campaign."""
        return (self.reduction.campaign.directory,)


def reduce(
    campaign: "str | os.PathLike[str] | Campaign" = "night-01",
    *,
    air_model: str = NOTES_AIR_MODEL,
    structure: "str | os.PathLike[str] | StructuralModel | None" = None,
    progress: Progress | None = None,
) -> NightResult:
    """A night's samples to coordinates, pose and surface, nothing moving meanwhile.

    campaign    directory laid out as the bundled night-01, its bundled name, or what `load` gave
    air_model   formula for the index of air; the working notes' without
    structure   structural model of the telescope, which displaces its typed places: its file, or what `load` gave; the
                campaign's own structural-model.toml without, a rigid telescope without that
    progress    called with (what, done, of how many)

    Raises InputError where the campaign cannot be used and EstimationError where the adjustment finds no answer.

    >>> night = reduce("night-01")
    >>> night.x.shape, night.verdict.word
    ((130, 3), 'good')
    """
    from catseye.reduction.epoch.epoch import reduce_epoch
    from catseye.reduction.epoch.settings import ReductionSettings

    records = with_structure(campaign_of(campaign), structure)
    reduction = reduce_epoch(records, ReductionSettings(air_model=air_model), progress)
    coordinates = reduction.coordinates
    return NightResult(
        verdict=reduction.verdict,
        names=tuple(coordinates.points),
        x=coordinates.x,
        u=coordinates.u,
        shots=np.array([coordinates.shots[k] for k in range(len(coordinates.points))]),
        variance_factor=coordinates.variance_factor,
        degrees_of_freedom=coordinates.degrees_of_freedom,
        rejected={shot: str(reason) for shot, reason in reduction.rejected.items()},
        refractivity_ppm=coordinates.refractivity_ppm,
        pose=None if reduction.surface is None else reduction.surface.pose(),
        notes=reduction.notes,
        reduction=reduction,
    )


def campaign_of(source: "str | os.PathLike[str] | Campaign") -> "Campaign":
    """The campaign itself, read where a path or a name was given."""
    from catseye.records.night.campaign import Campaign, read_campaign

    return source if isinstance(source, Campaign) else read_campaign(place_of(source))


@with_units
def night(
    directory: "str | os.PathLike[str]",
    *,
    seed: Annotated[Any, In("", whole=True)] = 2209,
    dish_prisms: Annotated[Any, In("", whole=True)] = 2209,
    azimuth_deg: Annotated[Any, In("deg", one=True)] = 145.3,
    elevation_deg: Annotated[Any, In("deg", one=True)] = 30.0,
    interval_s: Annotated[Any, In("s", one=True)] = 8.0,
    again: Annotated[Any, In("", one=True)] = 0.43,
    nature: Annotated[Any, In("", one=True)] = 1.0,
    frequencies_hz: Annotated[Any, In("Hz")] = (),
    lies: "Sequence[str]" = (),
    structure: "str | os.PathLike[str] | StructuralModel | None" = None,
) -> Path:
    """A simulated night as a campaign that `reduce` reads, and beside it `truth.json`, which `reduce` does not read.

    directory      new or empty
    seed           of every draw: the same night each time
    dish_prisms    0 to 9999; the telescope has 2209
    azimuth_deg, elevation_deg   of the telescope
    interval_s     between two shots of a ranger, s: above a buffer's 0.128, and short enough that all fit in a day
    again          how often each ranger of the feed arm shoots each prism once more; 0.43 makes some 20 000 shots
    nature         strength, 0 to 10, of waves, fronts, turbulence and gradients in the air, of thermometers that lag
                   and of a telescope that expands: at 1 up to nature's own, drawn from the seed; 0: smooth air that
                   drifts evenly, a rigid telescope
    frequencies_hz   further modulation frequencies, Hz, 1e9 to 2e9: every line is measured at each, besides 1.5e9, and
                   `reduce` finds the whole cycles by them
    lies           "KIND [NAME] [SIZE]", such as "monument ZY103 1": wrong records, while the truth stays what it is, or
                   nature that the reduction has no model of; kinds: docs/howto/lying-nights.md
    structure      structural model that bends the telescope; the campaign does not name it. None: a rigid telescope,
                   but for what the seed draws

    Raises InputError where the directory holds something or cannot be written, or a lie is unknown, and ValidityError
    for numbers beyond these.
    """
    from catseye.gateways.writers.output import new_directory
    from catseye.simulator.night.lies.lie import lying_night
    from catseye.simulator.night.nature import Nature
    from catseye.simulator.night.schedule import Schedule
    from catseye.simulator.night.sheets import named, write_files
    from catseye.simulator.night.simulate import SimulatedTelescope

    model = None if structure is None else structure_of(structure)
    with new_directory(Path(directory)) as fresh:
        made = lying_night(
            seed,
            lies,
            telescope=SimulatedTelescope(azimuth_deg, elevation_deg, dish_prisms, structure=model),
            schedule=Schedule(
                interval_s=interval_s, again=again, further_hz=tuple(np.atleast_1d(frequencies_hz).tolist())
            ),
            nature=Nature.drawn(seed, nature),
        )
        write_files(made, fresh)
        page = _truth_page(made, seed, nature)
        with named(fresh / "truth.json") as path:
            path.write_text(page, encoding="utf-8")
    return Path(directory)


def _truth_page(made: "Night", seed: int, nature: float) -> str:
    """Truth of a simulated night, for comparison with its reduction, as JSON."""
    from dataclasses import asdict

    from catseye.gateways.writers.objects import json_page

    truth = made.truth
    page = {
        "what": "the truth behind a simulated night: metres in the ground frame, status of each shot",
        "seed": seed,
        "nature": {"strength": nature, "points_hold_at_s": truth.reference_s, **asdict(truth.nature)},
        "lies": list(made.lies),
        "points": {name: {axis: x[k] for k, axis in enumerate("xyz")} for name, x in truth.points.items()},
        "surface_deviations": None if truth.paraboloid is None else truth.paraboloid.deviations,
        "shots": truth.shot_status,
    }
    return json_page(page)
