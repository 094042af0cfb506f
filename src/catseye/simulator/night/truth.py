"""Truth of a night, beyond its files."""

from dataclasses import dataclass

import numpy as np

from catseye.constants import PPM
from catseye.simulator.night.air import TrueAir
from catseye.simulator.night.expansion import MovingPoints
from catseye.simulator.night.head import Return
from catseye.simulator.night.nature import Nature
from catseye.simulator.night.paraboloid import GroundParaboloid, best_paraboloid
from catseye.simulator.night.posture import TruePosture
from catseye.simulator.night.schedule import REFERENCE
from catseye.simulator.night.stations import WeatherStations
from catseye.simulator.night.structure import Structure
from catseye.simulator.night.world import TrueHead, TrueMonument


@dataclass(frozen=True)
class Truth:
    """Truth of a night, in metres, radians, ground frame.

    Shots are keyed by their id as text, from '1'.

    points             every scan point, triplet target, dish prism, structural target, benchmark: name -> (3,), at
                       `reference_s` where the telescope expands: half-way from the first shot to the last
    shot_status        'good', 'blocked' or 'reflected' (reference shots are good)
    shot_ranges        straight distance scan point to reference point (a reference shot: D0)
    shot_phase_errors  phase error from a stray reflection, rad (0 for other shots)
    path_refractivity_ppm   (n_path - 1) 1e6 of every shot on a target
    refractivity_ppm   its mean over good shots; None without any
    d0, leakage, fixed_points, mirror_offsets   of the rangers (the last two: ground rangers)
    thermometer_offsets_c   reading minus air, station -> value, planted bias included
    normals            of prisms (entry face) and balls (their axis, outward), unit vectors
    paraboloid         best fit to the true dish prisms: axis, vertex, focus, normal deviations; None below six prisms
    posture            the departure from the nominal posture, for all points
    air                the air itself, a function of place and seconds since the start
    moving             the points at any time, `moving.at(names, seconds)`; `moving.scale(seconds)` is the expansion
    stations           places, time constants and radiation errors of the weather stations
    nature             all effects beyond smooth air and a rigid telescope
    wrongly_typed      name of the approximate position with the gross error (a triplet: TRnn)
    """

    points: dict[str, np.ndarray]
    shot_status: dict[str, str]
    shot_ranges: dict[str, float]
    shot_phase_errors: dict[str, float]
    path_refractivity_ppm: dict[str, float]
    refractivity_ppm: float | None
    d0: dict[str, float]
    leakage: dict[str, complex]
    fixed_points: dict[str, np.ndarray]
    mirror_offsets: dict[str, np.ndarray]
    thermometer_offsets_c: dict[str, float]
    normals: dict[str, np.ndarray]
    paraboloid: GroundParaboloid | None
    posture: TruePosture
    air: TrueAir
    moving: MovingPoints
    stations: WeatherStations
    nature: Nature
    wrongly_typed: str | None

    @property
    def reference_s(self) -> float:
        """Time at which points, paraboloid and posture hold, s since the start."""
        return self.moving.reference_s

    @property
    def thermometer_lags_s(self) -> dict[str, float]:
        """Time constants of the stations' thermometers."""
        return {station: self.nature.stations.lags_s.get(station, 0.0) for station in self.stations.places}


def truth_of(  # noqa: PLR0913 - keyword-only, from every part of the night
    *,
    heads: dict[str, TrueHead],
    monuments: dict[str, TrueMonument],
    telescope: Structure,
    moving: MovingPoints,
    returns: list[Return],
    stations: WeatherStations,
    thermometer_offsets_c: dict[str, float],
    pose: TruePosture,
    nature: Nature,
) -> Truth:
    """Collect the truth; returns in the order of the shots."""
    points = dict(moving.points)
    shots = {str(i + 1): r for i, r in enumerate(returns)}
    ranged = {i: r for i, r in shots.items() if r.shot.target != REFERENCE}
    good = [(r.index - 1.0) / PPM for r in ranged.values() if r.status == "good"]
    return Truth(
        points=points,
        shot_status={i: r.status for i, r in shots.items()},
        shot_ranges={i: r.range for i, r in shots.items()},
        shot_phase_errors={i: r.phase_error for i, r in shots.items()},
        path_refractivity_ppm={i: (r.index - 1.0) / PPM for i, r in ranged.items()},
        refractivity_ppm=float(np.mean(good)) if good else None,
        d0={r: h.true_d0 for r, h in heads.items()},
        leakage={r: h.true_leakage for r, h in heads.items()},
        fixed_points={r: m.true_fixed_point for r, m in monuments.items()},
        mirror_offsets={r: heads[r].true_offset for r in monuments},
        thermometer_offsets_c=thermometer_offsets_c,
        normals={name: t.normal for name, t in telescope.targets.items() if t.normal is not None},
        paraboloid=best_paraboloid({t.name: points[t.name] for t in telescope.dish}, pose),
        posture=pose,
        air=moving.air,
        moving=moving,
        stations=stations,
        nature=nature,
        wrongly_typed=telescope.wrongly_typed,
    )
