"""Changes of a running reduction: settings, positions of targets, the reference epoch of poses.

A change is journalled as an event at its place and replayed there, so that a replay stays the same bit for bit.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Literal

from catseye.errors import InputError
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.live.state import Carried, marginal

MotionModel = Literal["random_walk", "constant_velocity"]
Position = tuple[float, float, float]
OF_A_POINT = (ParameterKind.POINT, ParameterKind.REFERENCE_PLACE, ParameterKind.VELOCITY)


@dataclass(frozen=True)
class LiveChange:
    """A change of a live reduction; None leaves a part as it is.

    filter            motion model between epochs
    air_model         model of the index of air
    critical          |w| above which a shot is rejected
    smallest_return   amplitude over its own standard uncertainty below which a shot counts as blocked
    positions_mm      target: approximate position in the frame of its record; all that replace the records'
    reference         True to make the last epoch the reference epoch of poses
    """

    filter: MotionModel | None = None
    air_model: str | None = None
    critical: float | None = None
    smallest_return: float | None = None
    positions_mm: Mapping[str, Position] | None = None
    reference: bool = False

    @property
    def text(self) -> str:
        """JSON text for a journal.

        >>> LiveChange(critical=4.0).text
        '{"critical": 4.0}'
        """
        return json.dumps({name: value for name, value in asdict(self).items() if value not in (None, False)})

    @classmethod
    def of(cls, text: str) -> "LiveChange":
        """The change that a journal has.

        Raises InputError: unknown to this version.

        >>> LiveChange.of('{"critical": 4.0}').critical
        4.0
        """
        try:
            values: dict[str, Any] = json.loads(text)
            strange = sorted(set(values) - {item.name for item in fields(cls)})
        except (ValueError, TypeError) as problem:
            raise InputError(f"a change of the reduction cannot be read: {problem}") from problem
        if strange:
            raise InputError(
                f"a change of the reduction has {strange[0]!a} (expected a journal of this version or older)"
            )
        if "positions_mm" in values:
            values["positions_mm"] = {name: (x, y, z) for name, (x, y, z) in values["positions_mm"].items()}
        return cls(**values)

    def rules(self, before: ReductionSettings) -> ReductionSettings:
        """Settings of a reduction with this change."""
        named = {name: getattr(self, name) for name in ("air_model", "critical", "smallest_return")}
        return replace(before, **{name: value for name, value in named.items() if value is not None})


def placed(site: SiteFolder, recorded: SiteFolder, positions_mm: Mapping[str, Position]) -> SiteFolder:
    """A site with approximate positions in place of the records'.

    recorded   the site as its records have it, to which targets without a position return

    Raises InputError: no single target of the site has this name.
    """
    strange = [name for name in positions_mm if name not in recorded.targets]
    if strange:
        raise InputError(f"{strange[0][:20]!a} is not a target of the site with a position of its own")
    targets = {
        name: target.model_copy(update={"position_mm": positions_mm[name]}) if name in positions_mm else target
        for name, target in recorded.targets.items()
    }
    values = {item.name: getattr(site, item.name) for item in fields(SiteFolder)}
    return SiteFolder(**values | {"targets": targets})


def without_points(state: Carried, names: Sequence[str]) -> Carried:
    """The state without what is known of some points, which begin anew."""
    gone = {
        p
        for p in state.parameters
        if (p.kind in OF_A_POINT and p.of in names) or (p.kind is ParameterKind.PATH and p.part in names)
    }
    return marginal(state, gone)


def without_velocities(state: Carried) -> Carried:
    """The state of a random walk."""
    speeds: set[Parameter] = {p for p in state.parameters if p.kind is ParameterKind.VELOCITY}
    return marginal(state, speeds) if speeds else state
