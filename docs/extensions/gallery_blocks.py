"""Blocks of the gallery: their calls, evaluated in order, and the figures that these draw.

    ```{gallery} catseye.adjust("networks/ground-ring")
    :command: catseye adjust networks/ground-ring --out ring

    plan = Points with their error ellipses, from above
    elevation = The same from the side
    ```

The argument is a Python call of one result of catseye. Each line names a figure of `catseye.show` and says what it
shows. `:as: night` keeps the result for later calls. `:command:` is the same on the command line. Simulated inputs
that no bundled example has are `years`, `dishes`, `vibrating`, `epochs`, `moved`, `bending`, `bent`,
`first_night` and `todays_site`; see `GalleryCalls`.
"""

import json
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```\{gallery\} (?P<call>.+)\n(?P<body>(?:.*\n)*?)```$", re.MULTILINE)
OPTION = re.compile(r"^:(?P<name>[a-z]+): (?P<value>.+)$")
NIGHTS, POINTS = 45, 9  # of the simulated archive
SCENES = ("years", "dishes", "vibrating", "epochs", "moved", "bending", "bent", "first_night", "todays_site")


@dataclass(frozen=True)
class GalleryBlock:
    """One call with its figures.

    call      Python
    command   the same on the command line
    name      of the result for later calls; None: not kept
    lines     figure -> what it shows
    """

    call: str
    command: str
    name: str | None
    lines: dict[str, str]


def blocks_of(text: str) -> list[GalleryBlock]:
    """Blocks of a page, in order."""
    return [block_of(match["call"], match["body"].splitlines()) for match in BLOCK.finditer(text)]


def block_of(call: str, body: list[str]) -> GalleryBlock:
    """Block of a directive's argument and lines.

    Raises ValueError without a command, and for a line that names no figure.
    """
    options = {match["name"]: match["value"] for line in body if (match := OPTION.match(line))}
    if "command" not in options:
        raise ValueError(f"{call}: no command (expected `:command: catseye ...`)")
    lines: dict[str, str] = {}
    for line in body:
        if line.strip() and not OPTION.match(line):
            name, sign, text = line.partition(" = ")
            if not sign or not text.strip():
                raise ValueError(f"{call}: {line!r} (expected `figure = what it shows`)")
            lines[name.strip()] = text.strip()
    return GalleryBlock(call, options["command"], options.get("as"), lines)


class GalleryCalls:
    """Calls of one page, evaluated in a temporary directory.

    Use as a context.
    """

    def __enter__(self) -> "GalleryCalls":
        self._place = tempfile.TemporaryDirectory(prefix="catseye-gallery-")
        self._names: dict[str, Any] = {}
        return self

    def __exit__(self, *_problem: object) -> None:
        self._place.cleanup()

    @cached_property
    def years(self) -> Path:
        """Archive of nights with planted steps, drifts and a wrong thermometer."""
        from archive_scene import YearTruth, written_year

        truth = YearTruth(
            sag=0.0,
            steps={"ZP00002": (18, (0.0, 0.0, 1e-3))},
            zero_steps={"ZY107": (15, 3e-4)},
            zero_drift={"ZY103": 2e-3},
            thermometers={"WX2": 4.0},
            missing=tuple(range(25, 31)),
        )
        where = Path(self._place.name) / "years"
        written_year(where, NIGHTS, POINTS, seed=3, truth=truth)
        return where

    @cached_property
    def vibrating(self) -> Path:
        """Journal of two rangers that follow a target swinging at 1.2 Hz."""
        import numpy as np

        from catseye.coordinator.journal.entries import AnsweredShot
        from catseye.coordinator.journal.writer import Journal
        from catseye.records.night.live import LiveShot
        from catseye.simulator.clock.world_clock import ManualClock
        from journal_scene import START, scene_run

        where, rng = Path(self._place.name) / "vibration.db", np.random.default_rng(9)
        with Journal.open(str(where), run=scene_run(), clock=ManualClock(START / 1e8)) as writing:
            for number in range(1600):
                for ranger, late, gain in (("ZY101", 0, 1.0), ("ZY102", 60, -0.7)):
                    ticks = number * 148 + late
                    swing = gain * 6e-5 * np.cos(2 * np.pi * 1.2 * (ticks * 864e-6 + 0.064))
                    shot = LiveShot(
                        ranger, "ZEG1", START + ticks, 128, 64, 1000, 3e-4, None, 1.0, 0.0, 2 * number + late // 60
                    )
                    distance = 100.0 + swing + 2e-5 * rng.standard_normal()
                    writing.append(AnsweredShot(shot, "used", "", distance, 2e-5, 0.0))
        return where

    @cached_property
    def dishes(self) -> Path:
        """Archive of four nights of one telescope, with prisms on the dish."""
        import catseye

        place = Path(self._place.name)
        nights = [
            catseye.night(place / f"night-{k}", seed=7, dish_prisms=40, again=0.0, elevation_deg=elevation)
            for k, elevation in enumerate((20.0, 40.0, 60.0, 80.0))
        ]
        catseye.archive(place / "dishes", nights, processes=1)
        return place / "dishes"

    @cached_property
    def bent(self) -> Path:
        """Night at a low elevation of a telescope that bends as the bundled structural model."""
        import catseye

        model = catseye.examples("structural-model/telescope.toml")
        options = {"elevation_deg": 15.0, "dish_prisms": 12, "interval_s": 14.0, "again": 0.0}
        return Path(catseye.night(Path(self._place.name) / "bent", structure=model, **options))

    @cached_property
    def first_night(self) -> str:
        """Identifier of the first night of `dishes`."""
        import catseye

        return str(catseye.query(self.dishes).to_table()["night"][0])

    @cached_property
    def todays_site(self) -> Path:
        """Records of `dishes` with another D0 of one ranger on the feed arm, by 0.2 mm."""
        import shutil

        where, before = Path(self._place.name) / "today", self.dishes.parent / "night-0"
        shutil.copytree(before, where)
        mirror = where / "mirrors" / "ZP113.toml"
        lines = mirror.read_text(encoding="utf-8").splitlines()
        for k, line in enumerate(lines):
            if line.startswith("d0_mm"):
                lines[k] = f"d0_mm = {float(line.partition('=')[2]) + 0.2:.3f}"
        mirror.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return where

    @cached_property
    def epochs(self) -> Path:
        """Reductions of a body that bends with the cosine of the elevation."""
        import numpy as np

        from catseye.constants import ARCSECOND, DEGREE
        from catseye.geometry.antenna.frames import ground_from_reflector
        from catseye.geometry.frames.rotation import from_vector
        from catseye.records.network.solved_points import FORMAT

        rng, folder = np.random.default_rng(8), Path(self._place.name) / "epochs"
        rest = np.array([[0.0, 5, 40], [8, 6, 48], [-8, 7, 50], [1, 12, 58]])
        shift, turn = np.array([0.002, 0.010, -0.001]), np.array([40.0, 0.0, 5.0]) * ARCSECOND
        names = [f"ZEG{k}" for k in (1, 2, 3, 4)]
        for k, elevation in enumerate(np.linspace(10.0, 80.0, 10)):
            cos = np.cos(elevation * DEGREE)
            places = ground_from_reflector(2.5, elevation * DEGREE).points(
                cos * shift + rest @ from_vector(cos * turn).T
            ) + 5e-5 * rng.standard_normal((4, 3))
            solved = {
                "format": FORMAT,
                "frame": "ground",
                "points": {n: dict(zip("xyz", x, strict=True)) for n, x in zip(names, places.tolist(), strict=True)},
                "covariance_order": [f"{name} {axis}" for name in names for axis in "xyz"],
                "covariance": (2.5e-9 * np.eye(12)).tolist(),
            }
            posture = {"azimuth_deg": 2.5 / DEGREE, "elevation_deg": elevation}
            night = folder / f"night-{k}"
            night.mkdir(parents=True)
            (night / "coordinates.json").write_text(json.dumps(solved), encoding="utf-8")
            (night / "pose.json").write_text(
                json.dumps({"format": FORMAT, "nominal_posture": posture}), encoding="utf-8"
            )
        return folder

    @cached_property
    def moved(self) -> Path:
        """Ground ring of the examples as ranges to targets, one of them raised by 3 mm."""
        import csv

        import catseye

        source, where = catseye.examples("networks/ground-ring"), Path(self._place.name) / "moved"
        where.mkdir()
        answer = catseye.adjust(source)
        places = dict(zip(answer.names, answer.x, strict=True))
        (where / "points.csv").write_text((source / "points.csv").read_text(encoding="utf-8"), encoding="utf-8")
        with (
            (source / "ranges.csv").open(encoding="utf-8") as read,
            (where / "ranges.csv").open("w", encoding="utf-8") as written,
        ):
            table = csv.writer(written, lineterminator="\n")
            table.writerow(["from", "to", "distance", "sigma"])
            for row in csv.DictReader(read):
                way = places[row["to"]] - places[row["from"]]
                longer = 0.003 * way[2] / float((way @ way) ** 0.5) if row["to"] == "T01" else 0.0
                table.writerow([row["from"], row["to"], f"{float(row['distance']) + longer:.7f}", row["sigma"]])
        return where

    @cached_property
    def bending(self) -> dict[str, Any]:
        """Arguments of `catseye.surface`: 200 prisms at seven elevations, with a trefoil that goes as its cosine."""
        import numpy as np

        rng = np.random.default_rng(4)
        radius, angle = 48 * np.sqrt((np.arange(200) + 0.5) / 200), np.arange(200) * np.pi * (3 - 5**0.5)
        x, y = radius * np.cos(angle), 54 + radius * np.sin(angle)
        elevation = np.linspace(80, 10, 7)
        bend = 4e-4 * (radius / 50) ** 3 * np.cos(3 * angle) * np.cos(np.radians(elevation))[:, None]
        z = (x**2 + y**2) / 240 + bend + 5e-5 * rng.standard_normal((7, 200))
        places = np.stack([np.broadcast_to(x, z.shape), np.broadcast_to(y, z.shape), z], axis=2)
        return {"points": places, "u": 5e-5, "elevation_deg": elevation}

    def result(self, block: GalleryBlock) -> Any:
        """Result of a block's call."""
        import catseye

        with _imports(), _inside(self._place.name):
            words = set(re.findall(r"\w+", block.call))
            scenes = {name: getattr(self, name) for name in SCENES if name in words}
            found = eval(block.call, {"catseye": catseye, **scenes, **self._names})  # noqa: S307 - our own page
        if block.name is not None:
            self._names[block.name] = found
        return found

    def figures(self, block: GalleryBlock) -> tuple[Any, dict[str, Any]]:
        """Result of a block's call, and its figures by name.

        Raises ValueError where the figures are not those that the block names.
        """
        import catseye

        found = self.result(block)
        drawn = catseye.show(found)
        missing, unknown = sorted(set(drawn) - set(block.lines)), sorted(set(block.lines) - set(drawn))
        if missing or unknown:
            problems = [f"no line on {name!r}" for name in missing] + [f"no figure {name!r}" for name in unknown]
            raise ValueError(f"{block.call}: {', '.join(problems)}")
        return found, drawn


@contextmanager
def _inside(place: str) -> Iterator[None]:
    """Work in a directory for a while."""
    before = Path.cwd()
    os.chdir(place)
    try:
        yield
    finally:
        os.chdir(before)


@contextmanager
def _imports() -> Iterator[None]:
    """Import the simulated scenes of the tests for a while."""
    before = list(sys.path)
    sys.path.append(str(ROOT / "tests"))
    try:
        yield
    finally:
        sys.path[:] = before
