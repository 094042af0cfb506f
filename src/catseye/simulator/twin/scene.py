"""True places at any time: scan points, mirrors, retroreflectors; beam candidates."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from catseye.aliases import Array
from catseye.errors import InputError
from catseye.records.site.folder import SiteFolder
from catseye.records.site.retroreflector import HOLLOW
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.head import USUAL_VOLT
from catseye.simulator.twin.stations import BeamAtMirror, TrueStation, stations
from catseye.simulator.twin.targets import CORNER_RADIUS, BodyRetroreflector, drawing, retroreflectors
from catseye.simulator.twin.telescope import TelescopeState, low_orders, turning

ASIDE = CORNER_RADIUS + 0.15  # m: distance from the beam within which a target is checked closely; bending is far below
NEAREST = 0.5  # m: nearer objects belong to the ranger


class StationFrame(NamedTuple):
    """Mirror at k times: scan point (k, 3), m, ground; `mirror_from_ground` (k, 3, 3)."""

    scan_point: Array
    mirror_from_ground: Array


class Beam(NamedTuple):
    """Beam at k times, ground frame.

    Its origin on the mirror (k, 3), m, direction (k, 3), `BeamAtMirror.path` (k,), m.
    """

    origin: Array
    direction: Array
    path: Array


@dataclass(frozen=True, eq=False)
class Crowd:
    """Retroreflectors of one body.

    Names, rest places (n, 3), m; on the dish normals (n, 3) and low orders (n, 6).
    """

    names: tuple[str, ...]
    rest_place: Array
    up: Array
    orders: Array


class TwinPlaces:
    """Places of a site's objects.

    site   its records

    Raises InputError: a planted shift or D0 of a name that the site does not have.
    """

    def __init__(self, site: SiteFolder, *, streams: Streams, planted: Planted):
        draw = drawing(site, streams, planted)
        self.stations: dict[str, TrueStation] = stations(site, draw)
        certified = {name: s.place + s.gamma.T @ s.offset for name, s in self.stations.items() if s.body == "ground"}
        self.retros: dict[str, BodyRetroreflector] = retroreflectors(site, certified, draw)
        for name, s in self.stations.items():  # a ranger shows others the retroreflector in its mirror's back
            rest_place = s.place if s.body == "arm" else certified[name]
            self.retros[name] = BodyRetroreflector(
                kind=HOLLOW, body=s.body, rest_place=rest_place, facing=None, sizes=(), volts=USUAL_VOLT["arm"]
            )
        self._surface = draw.surface
        self._dish_middle = np.array([*draw.surface.centre, draw.surface.height(draw.surface.centre)])
        self._crowds = {body: self._crowd(body) for body in ("ground", "alidade", "dish", "arm")}
        self._rows = {name: row for crowd in self._crowds.values() for row, name in enumerate(crowd.names)}
        self._shifts = {name: np.array(by, dtype=float) for name, by in planted.shifts.items()}
        for name in self._shifts:
            self._owner(name)

    def _crowd(self, body: str) -> Crowd:
        names = tuple(name for name, retro in self.retros.items() if retro.body == body)
        rest_place = np.array([self.retros[name].rest_place for name in names]).reshape(-1, 3)
        up, orders = np.zeros((len(rest_place), 3)), np.zeros((len(rest_place), 6))
        if body == "dish" and len(rest_place):
            up = self._surface.up(rest_place[:, :2])
            orders = low_orders(rest_place[:, :2], self._surface.centre, self._surface.radius)
        return Crowd(names, rest_place, up, orders)

    def _owner(self, name: str) -> str:
        """Object of a name or of a fixed point's name; InputError if unknown."""
        base = name.removesuffix("-F")
        if name not in self.retros and not (base in self.stations and self.stations[base].body == "ground"):
            raise InputError(f"point {name!r} is not at this site (expected a target, a ranger or a ranger's -F)")
        return base if name not in self.retros else name

    def point(self, name: str, seconds: Array, state: TelescopeState) -> Array:
        """True place of a point (k, 3), m, ground frame."""
        owner = self._owner(name)
        station = self.stations.get(owner)
        if station is not None and station.body == "ground":
            place, turned = station.settled(seconds)
            if name == owner:
                place = place + turning(turned) @ (station.gamma.T @ station.offset)
        else:
            place = self._ridden(self.retros[owner].body, [self._rows[owner]], state)[:, 0]
        return place + self._shifts.get(name, 0.0)

    def points(self, names: Iterable[str], seconds: Array, state: TelescopeState) -> Array:
        """True places (k, n, 3), m, ground frame, body by body."""
        names = list(names)
        places = np.empty((len(seconds), len(names), 3))
        riding: dict[str, list[int]] = {}
        for i, name in enumerate(names):
            if self._owner(name) in self.stations and self.stations[self._owner(name)].body == "ground":
                places[:, i] = self.point(name, seconds, state)
            else:
                riding.setdefault(self.retros[name].body, []).append(i)
        for body, at in riding.items():
            places[:, at] = self._ridden(body, [self._rows[names[i]] for i in at], state)
            for i in at:
                if names[i] in self._shifts:
                    places[:, i] += self._shifts[names[i]]
        return places

    def _ridden(self, body: str, rows: list[int], state: TelescopeState) -> Array:
        """Places (k, m, 3) of a body's rows, with the telescope's expansion.

        Ground points do not expand.
        """
        crowd, (turn, shift) = self._crowds[body], state.bodies[body]
        rest_place = crowd.rest_place[rows]
        if body == "dish":
            bent = state.orders @ crowd.orders[rows].T
            rest_place = rest_place + bent[..., None] * crowd.up[rows]
            rest_place = rest_place + state.dish_scale[:, None, None] * (rest_place - self._dish_middle)
        place = rest_place @ np.swapaxes(turn, -1, -2) + shift[:, None]
        return place if body == "ground" else place * (1.0 + state.scale[:, None, None])

    def facing(self, name: str, state: TelescopeState) -> Array | None:
        """Direction of a retroreflector (k, 3), ground frame; None: any."""
        retro = self.retros[name]
        return None if retro.facing is None else state.bodies[retro.body].turn @ retro.facing

    def station(self, ranger: str) -> TrueStation:
        """True station of a ranger. Raises InputError if unknown."""
        if ranger not in self.stations:
            raise InputError(f"ranger {ranger!r} is not at this site (expected one of {', '.join(self.stations)})")
        return self.stations[ranger]

    def frame(self, ranger: str, seconds: Array, state: TelescopeState) -> StationFrame:
        """Frame of a ranger's mirror at k times."""
        station = self.station(ranger)
        mirror = station.lambda_ @ station.gamma
        if station.body == "arm":
            scan = self.point(ranger, seconds, state)
            return StationFrame(scan, mirror @ np.swapaxes(state.bodies["arm"].turn, -1, -2))
        place, turned = station.settled(seconds)
        turn = turning(turned)
        scan = place + turn @ (station.gamma.T @ station.offset) + self._shifts.get(ranger, 0.0)
        return StationFrame(scan, mirror @ np.swapaxes(turn, -1, -2))

    def beam(self, frame: StationFrame, ray: BeamAtMirror) -> Beam:
        """Ray of the mirror in the ground frame."""
        turn = frame.mirror_from_ground
        leaves, direction = ((v[:, None] @ turn)[:, 0] for v in (ray.leaves, ray.direction))
        return Beam(frame.scan_point + leaves, direction, ray.path)

    def near(self, beam: Beam, state: TelescopeState, k: int) -> list[str]:
        """Names possibly in a beam at its k-th time, nearest first.

        Rest places within `ASIDE` of it.
        """
        by_distance: list[tuple[float, str]] = []
        for body, crowd in self._crowds.items():
            turn, shift = state.bodies[body].turn[k], state.bodies[body].shift[k]
            sight = crowd.rest_place - (beam.origin[k] - shift) @ turn
            along = sight @ (beam.direction[k] @ turn)
            off = np.einsum("ij,ij->i", sight, sight) - along**2
            for i in np.flatnonzero((off < ASIDE**2) & (along > NEAREST)):
                by_distance.append((float(off[i]), crowd.names[i]))
        return [name for _, name in sorted(by_distance)]
