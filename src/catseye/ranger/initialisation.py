"""Initialisation of a ranger from a site's records: commands and files.

A ranger works in one frame, in which its BP, ALPHA, SUN and all coordinates of cubes are given: a ground ranger in the
ground frame, one on the feed arm in the reflector frame, with which it turns. Cubes have the same numbers on all
rangers of a site.
"""

from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.mirror.pointing import MirrorStation
from catseye.ranger.commands import MOST_CUBES
from catseye.ranger.line import Request
from catseye.records.site.folder import REFERENCE, SiteFolder
from catseye.records.site.mirror import Mirror
from catseye.records.site.target import FeedArmRanger
from catseye.reduction.site.places import RangedPoint, nominal_frame, places_of
from catseye.reduction.site.stations import offset_of, station_of

FILTER = ("FKP", "FKI", "FKD", "FIL", "FSI")
BOOT_ACCELERATION = 2_000  # of a ranger's AxisSettings
Frame = Literal["ground", "reflector"]


def frame_of(site: SiteFolder, ranger: str) -> Frame:
    """Frame of a ranger's base point, cubes and Sun vector.

    Raises InputError: no such ranger.
    """
    if ranger in site.monuments:
        return "ground"
    _feed_arm_record(site, ranger)
    return "reflector"


def mount_from_reflector(site: SiteFolder, ranger: str) -> NDArray[np.float64]:
    """Mount axes (3, 3) of a feed-arm ranger, in the reflector frame.

    By its record or else the default, chosen: y^ points at the centre of the dish, z^ along the reflector's x as far as
    possible; so the dish lies within 45 deg of Theta = Phi = 90 deg, far from the azimuth axis, where a mirror cannot
    follow, and from the stops.
    """
    record = _feed_arm_record(site, ranger)
    if record.mount_z is not None and record.mount_y is not None:
        z = np.array(record.mount_z) / np.linalg.norm(record.mount_z)
        y = np.array(record.mount_y) - z * (z @ np.array(record.mount_y))
        y /= np.linalg.norm(y)
    else:
        y = _unit(dish_centre(site) - np.array(record.nominal_scan_point_mm) * MILLIMETRE)
        z = _unit(np.array([1.0, 0.0, 0.0]) - y[0] * y)
    return np.stack([np.cross(y, z), y, z])


def dish_centre(site: SiteFolder) -> NDArray[np.float64]:
    """Paraboloid point (3,) over the aperture's centre, m, reflector frame."""
    x, y = (value * MILLIMETRE for value in site.site.paraboloid.aperture_centre_mm)
    return np.array([x, y, (x**2 + y**2) / (4.0 * site.site.paraboloid.focal_length_mm * MILLIMETRE)])


def local_station(site: SiteFolder, ranger: str) -> MirrorStation:
    """The mirror on its mount, in the ranger's frame.

    For the feed arm that is the reflector frame.

    Source: [PARKER04] section 2.2.
    """
    mirror = site.mirror_of(ranger)
    if ranger in site.monuments:
        return station_of(site.monuments[ranger], mirror)
    record = _feed_arm_record(site, ranger)
    return MirrorStation.from_matrix(
        np.array(record.nominal_scan_point_mm) * MILLIMETRE,
        mount_from_reflector(site, ranger),
        offset=offset_of(mirror),
        beta=np.array([mirror.beta1_rad, mirror.beta2_rad]),
        zeros=np.array([mirror.na0, mirror.ne0]),
    )


def cube_numbers(site: SiteFolder) -> dict[str, int]:
    """Number of every cube by its target's name, equal on all rangers.

    ZRG is 0, the others in alphabetical order.

    Raises InputError: more than a ranger has room for.
    """
    names = [name for name in site.target_names if name != REFERENCE]
    if len(names) > MOST_CUBES:
        raise InputError(f"site {site.site.campaign.name} has {len(names)} targets (expected at most {MOST_CUBES})")
    return {REFERENCE: 0, **{name: number for number, name in enumerate(names, start=1)}}


def monument_commands(site: SiteFolder, ranger: str) -> list[Request]:
    """BP and ALPHA, in the ranger's frame."""
    station = local_station(site, ranger)
    return [
        _command("BP", *(f"{v:.4f}" for v in station.fixed_point / MILLIMETRE)),
        _command("ALPHA", *(f"{v:.9f}" for v in station.alpha)),
    ]


def head_commands(site: SiteFolder, ranger: str) -> list[Request]:
    """BETA, MO, EZ, D0, counts of ZRG, and the mirror's motion settings."""
    mirror = site.mirror_of(ranger)
    return [
        _command("BETA", f"{mirror.beta1_rad:.9f}", f"{mirror.beta2_rad:.9f}"),
        _command("MO", *(f"{v:.4f}" for v in (mirror.dx_mm, mirror.dy_mm, mirror.dz_mm))),
        _command("EZ", f"{mirror.na0:.10g}", f"{mirror.ne0:.10g}"),
        _command("D0", f"{mirror.d0_mm:.4f}"),
        _command("AZM", 0, mirror.azm_zrg),
        _command("ELV", 0, mirror.elv_zrg),
        *(command for axis in (0, 1) for command in _motion(mirror, axis)),
    ]


def commands_of_ranger(site: SiteFolder, ranger: str, targets: Iterable[str] | None = None) -> list[Request]:
    """All initialisation commands of a ranger: monument, head, cubes.

    Amplifiers, homing and the Sun are not included.

    site      its records
    ranger    name
    targets   names of the cubes; None: all

    Raises InputError: no such ranger or target, or more targets than a ranger has room for.
    """
    return SiteCommands(site).of_ranger(ranger, targets)


class SiteCommands:
    """Initialisation commands of all rangers of a site.

    Thousands of cubes are the same on each ranger of a frame: theirs are made once, and shared.
    """

    def __init__(self, site: SiteFolder):
        self._site, self._places, self._numbers = site, places_of(site), cube_numbers(site)
        self._placed: dict[Frame, dict[str, Request]] = {}
        self._constants = {
            name: _command("KND", self._numbers[name], "S", f"{place.constant / MILLIMETRE:.4f}")
            for name, place in self._places.items()
            if place.constant != 0.0
        }

    def of_cubes(self, ranger: str, targets: Iterable[str] | None = None) -> list[Request]:
        """INI, then COO and KND of the targets but ZRG and itself.

        targets   names; None: all
        """
        at, numbers = self._cubes(frame_of(self._site, ranger)), self._numbers
        certified = {b.target: b.certified_distance_mm for b in self._site.benchmarks if b.ranger == ranger}
        commands = [_command("INI", len(numbers) - 1)]
        for name in at if targets is None else targets:
            if name in (REFERENCE, ranger):
                continue
            if name not in at:
                raise InputError(f"unknown target {name} (expected one of the site's {len(at) - 1} targets)")
            commands.append(at[name])
            if name in certified:
                commands.append(_command("KND", numbers[name], "B", f"{certified[name]:.4f}"))
            elif name in self._constants:
                commands.append(self._constants[name])
        return commands

    def of_ranger(self, ranger: str, targets: Iterable[str] | None = None) -> list[Request]:
        """Commands as `commands_of_ranger` gives them."""
        cubes = self.of_cubes(ranger, targets)
        return [*monument_commands(self._site, ranger), *head_commands(self._site, ranger), *cubes]

    def files(self, ranger: str) -> dict[str, str]:
        """Initialisation files: text by name, in INITZY's order.

        They are CUBES.INI, ZYnnn.INI and the head's file. Ground rangers share their CUBES.INI except for benchmarks,
        and that none is its own target.
        """
        site, zp, frame = self._site, self._site.mirror_of(ranger).zp, frame_of(self._site, ranger)
        return {
            "CUBES.INI": _text(f"targets of {site.site.campaign.name}, {frame} frame", self.of_cubes(ranger)),
            f"{ranger.upper()}.INI": _text(f"mount of {ranger}, {frame} frame", monument_commands(site, ranger)),
            f"{zp.lower()}.INI": _text(f"head and mirror {zp}", head_commands(site, ranger)),
        }

    def _cubes(self, frame: Frame) -> dict[str, Request]:
        """COO by target, in the alphabet's order, of a frame's rangers."""
        if frame not in self._placed:
            at = _in_frame(self._site, frame, self._places)
            self._placed[frame] = {
                name: _command("COO", self._numbers[name], *(f"{v:.3f}" for v in at[name].tolist()), name)
                for name in sorted(at)
            }
        return self._placed[frame]


def _in_frame(site: SiteFolder, frame: Frame, places: Mapping[str, RangedPoint]) -> dict[str, NDArray[np.float64]]:
    points = np.array([place.start for place in places.values()])
    if frame == "reflector":
        points = nominal_frame(site).inverse().points(points)
    return dict(zip(places, points / MILLIMETRE, strict=True))


def _motion(mirror: Mirror, axis: int) -> list[Request]:
    """Filter, error limit, speed and acceleration from the record, in a valid order."""
    slow = (getattr(mirror, f"abv_{axis}") or BOOT_ACCELERATION) < BOOT_ACCELERATION
    order = (*FILTER, "ERL", *(("ABA", "ABV") if slow else ("ABV", "ABA")))
    values = {name: getattr(mirror, f"{name.lower()}_{axis}") for name in order}
    if slow and values["ABA"] is None:
        values["ABA"] = values["ABV"]  # the velocity must not be below the acceleration
    return [_command(name, axis, value) for name, value in values.items() if value is not None]


def _feed_arm_record(site: SiteFolder, ranger: str) -> FeedArmRanger:
    ranger_record = next((record for record in site.feedarm.ranger if record.name == ranger), None)
    if ranger_record is None:
        raise InputError(
            f"unknown ranger {ranger} at {site.site.campaign.name} (expected one of {', '.join(site.rangers)})"
        )
    return ranger_record


def _command(name: str, *values: object) -> Request:
    return Request(name, tuple(str(value) for value in values))


def _text(title: str, commands: list[Request]) -> str:
    return "\n".join([f"; {title}", *(f"{c.command} {', '.join(c.parameters)}" for c in commands), ""])


def _unit(v: NDArray[np.float64]) -> NDArray[np.float64]:
    return v / np.linalg.norm(v)
