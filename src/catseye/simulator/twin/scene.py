"""Where all that light meets stands at times: scan points, mirrors, retroreflectors; and what a beam may fall on."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catseye.errors import InputError
from catseye.records.site.folder import SiteFolder
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.head import USUAL_VOLT
from catseye.simulator.twin.stations import BeamAtMirror, TrueStation, stations
from catseye.simulator.twin.targets import PRISM_RADIUS, BodyRetroreflector, drawing, retroreflectors
from catseye.simulator.twin.telescope import TelescopeStanding, low_orders, turning

Array = NDArray[np.float64]
ASIDE = PRISM_RADIUS + 0.15  # m: how far from the beam a target is looked at closely; bending stays far below
NEAREST = 0.5  # m: what is nearer is the ranger's own


class StationFrame(NamedTuple):
    """A mirror at k times: scan point (k, 3), m, ground; `mirror_from_ground` (k, 3, 3)."""

    scan_point: Array
    mirror_from_ground: Array


class Beam(NamedTuple):
    """A beam at k times, ground: where it leaves the mirror (k, 3), m, direction (k, 3), `BeamAtMirror.way` (k,), m."""

    origin: Array
    direction: Array
    way: Array


@dataclass(frozen=True, eq=False)
class Crowd:
    """The retroreflectors of one body: names, rests (n, 3), m; on the dish normals (n, 3) and low orders (n, 6)."""

    names: tuple[str, ...]
    rest: Array
    up: Array
    orders: Array


class TwinPlaces:
    """The places of a site's things.

    site   its records

    Raises InputError: a planted shift or D0 of a name that the site does not have.
    """

    def __init__(self, site: SiteFolder, *, streams: Streams, planted: Planted):
        draw = drawing(site, streams, planted)
        self.stations: dict[str, TrueStation] = stations(site, draw)
        certified = {name: s.place + s.gamma.T @ s.offset for name, s in self.stations.items() if s.body == "ground"}
        self.retros: dict[str, BodyRetroreflector] = retroreflectors(site, certified, draw)
        for name, s in self.stations.items():  # a ranger shows others the retroreflector in its mirror's back
            rest = s.place if s.body == "arm" else certified[name]
            self.retros[name] = BodyRetroreflector("hollow", s.body, rest, None, (), USUAL_VOLT["arm"])
        self._surface = draw.surface
        self._dish_middle = np.array([*draw.surface.centre, draw.surface.height(draw.surface.centre)])
        self._crowds = {body: self._crowd(body) for body in ("ground", "alidade", "dish", "arm")}
        self._rows = {name: row for crowd in self._crowds.values() for row, name in enumerate(crowd.names)}
        self._shifts = {name: np.array(by, dtype=float) for name, by in planted.shifts.items()}
        for name in self._shifts:
            self._known(name)

    def _crowd(self, body: str) -> Crowd:
        names = tuple(name for name, retro in self.retros.items() if retro.body == body)
        rest = np.array([self.retros[name].rest for name in names]).reshape(-1, 3)
        up, orders = np.zeros((len(rest), 3)), np.zeros((len(rest), 6))
        if body == "dish" and len(rest):
            up = self._surface.up(rest[:, :2])
            orders = low_orders(rest[:, :2], self._surface.centre, self._surface.radius)
        return Crowd(names, rest, up, orders)

    def _known(self, name: str) -> str:
        """The name of the thing that a name or a fixed point's name belongs to; InputError for a stranger."""
        base = name.removesuffix("-F")
        if name not in self.retros and not (base in self.stations and self.stations[base].body == "ground"):
            raise InputError(f"point {name!r} is not at this site (expected a target, a ranger or a ranger's -F)")
        return base if name not in self.retros else name

    def point(self, name: str, seconds: Array, standing: TelescopeStanding) -> Array:
        """True place of a point (k, 3), m, ground frame."""
        known = self._known(name)
        station = self.stations.get(known)
        if station is not None and station.body == "ground":
            place, turned = station.settled(seconds)
            if name == known:
                place = place + turning(turned) @ (station.gamma.T @ station.offset)
        else:
            place = self._ridden(self.retros[known].body, [self._rows[known]], standing)[:, 0]
        return place + self._shifts.get(name, 0.0)

    def points(self, names: Iterable[str], seconds: Array, standing: TelescopeStanding) -> Array:
        """True places (k, n, 3), m, ground frame; what rides on one body is done at once."""
        names = list(names)
        places = np.empty((len(seconds), len(names), 3))
        riding: dict[str, list[int]] = {}
        for i, name in enumerate(names):
            if self._known(name) in self.stations and self.stations[self._known(name)].body == "ground":
                places[:, i] = self.point(name, seconds, standing)
            else:
                riding.setdefault(self.retros[name].body, []).append(i)
        for body, at in riding.items():
            places[:, at] = self._ridden(body, [self._rows[names[i]] for i in at], standing)
            for i in at:
                if names[i] in self._shifts:
                    places[:, i] += self._shifts[names[i]]
        return places

    def _ridden(self, body: str, rows: list[int], standing: TelescopeStanding) -> Array:
        """(k, m, 3) of rows of a body's crowd; what is not on the ground expands with the telescope."""
        crowd, (turn, shift) = self._crowds[body], standing.bodies[body]
        rest = crowd.rest[rows]
        if body == "dish":
            bent = standing.orders @ crowd.orders[rows].T
            rest = rest + bent[..., None] * crowd.up[rows]
            rest = rest + standing.dish_scale[:, None, None] * (rest - self._dish_middle)
        place = rest @ np.swapaxes(turn, -1, -2) + shift[:, None]
        return place if body == "ground" else place * (1.0 + standing.scale[:, None, None])

    def facing(self, name: str, standing: TelescopeStanding) -> Array | None:
        """Where a retroreflector looks (k, 3), ground frame; None: any way."""
        retro = self.retros[name]
        return None if retro.facing is None else standing.bodies[retro.body].turn @ retro.facing

    def station(self, ranger: str) -> TrueStation:
        """A ranger. Raises InputError for a stranger."""
        if ranger not in self.stations:
            raise InputError(f"ranger {ranger!r} is not at this site (expected one of {', '.join(self.stations)})")
        return self.stations[ranger]

    def frame(self, ranger: str, seconds: Array, standing: TelescopeStanding) -> StationFrame:
        """Where a ranger's mirror stands."""
        station = self.station(ranger)
        mirror = station.lambda_ @ station.gamma
        if station.body == "arm":
            scan = self.point(ranger, seconds, standing)
            return StationFrame(scan, mirror @ np.swapaxes(standing.bodies["arm"].turn, -1, -2))
        place, turned = station.settled(seconds)
        turn = turning(turned)
        scan = place + turn @ (station.gamma.T @ station.offset) + self._shifts.get(ranger, 0.0)
        return StationFrame(scan, mirror @ np.swapaxes(turn, -1, -2))

    def beam(self, frame: StationFrame, ray: BeamAtMirror) -> Beam:
        """A ray of the mirror in the ground frame."""
        turn = frame.mirror_from_ground
        leaves, direction = ((v[:, None] @ turn)[:, 0] for v in (ray.leaves, ray.direction))
        return Beam(frame.scan_point + leaves, direction, ray.way)

    def near(self, beam: Beam, standing: TelescopeStanding, k: int) -> list[str]:
        """Names of what may lie in a beam at its k-th time: rests within `ASIDE` of it, nearest first."""
        by_distance: list[tuple[float, str]] = []
        for body, crowd in self._crowds.items():
            turn, shift = standing.bodies[body].turn[k], standing.bodies[body].shift[k]
            sight = crowd.rest - (beam.origin[k] - shift) @ turn
            along = sight @ (beam.direction[k] @ turn)
            off = np.einsum("ij,ij->i", sight, sight) - along**2
            for i in np.flatnonzero((off < ASIDE**2) & (along > NEAREST)):
                by_distance.append((float(off[i]), crowd.names[i]))
        return [name for _, name in sorted(by_distance)]
