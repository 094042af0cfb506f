"""Cost of a thousand rangers: a generated site, its measured units, and the ten-year bill drawn from them.

python studies/thousand_rangers.py site DIRECTORY [--rangers 1000] [--targets 8]
"""

import argparse
import json
import math
import resource
import sqlite3
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

import catseye
from catseye.api.live.serving import read_site_of
from catseye.clock import SystemClock
from catseye.constants import DEGREE, MILLIMETRE
from catseye.coordinator.journal.entries import AnsweredShot, Run
from catseye.coordinator.journal.writer import Journal
from catseye.coordinator.plan.round import RoundPlanner
from catseye.coordinator.visibility.vantage import vantages_of
from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, STYLE, Figure, mpl, svg
from catseye.gateways.writers.output import atomic_directory
from catseye.records.night.live import TICKS_PER_DAY, LiveShot
from catseye.records.site.folder import SiteFolder, site_files
from catseye.records.site.target import BenchmarkRow, TargetRow
from catseye.reduction.live import live

FIELD = 18  # rangers of a field, as many as Green Bank's site has
SPACING = 800.0  # m between fields: no ranger sees a target of the next one (500 m at most)
RINGS = (70.0, 110.0)  # m, radii of a field's rangers about its structure
BENCHMARKS = 6  # of a field
EARTH = 6_371e3  # m
U_CERTIFIED_MM = 0.020
ROUND = 10.0  # s
YEAR, YEARS = 365.25 * 86_400.0, 10  # s of measuring day and night; years
RAW = 16_384  # bytes of a buffer
ARCHIVED = 0.75  # of the raw bytes, as blosc2 frames
SIZES, REGION = (18, 200, 1000), 36  # rangers
EUR_TB, COPIES, LASTS = 25.0, 2, 5  # assumed: price of a disk with its share of a server, copies, years
EUR_CORE_YEAR = 80.0  # assumed: of a server's core with power
SAMPLED = 0.01  # s between two looks at the loop


def field_centres():
    """Centres (x, y), m, of fields on a square grid, outwards in rings; the origin is Green Bank's."""
    ring = 0
    while True:
        ring += 1
        cells = [(i, j) for i in range(-ring, ring + 1) for j in range(-ring, ring + 1) if max(abs(i), abs(j)) == ring]
        yield from ((SPACING * i, SPACING * j) for i, j in cells)


def large_site(rangers: int, targets: int) -> SiteFolder:
    """Green Bank's site, and fields of 18 rangers on the ground about it until there are enough.

    rangers   in all, 18 or more
    targets   hollow retroreflectors on the structure of each field
    """
    site = read_site_of("gbt")
    random = np.random.default_rng(rangers)
    mirrors, monuments = list(site.mirrors.values()), list(site.monuments.values())
    extra = rangers - len(site.rangers)
    fields = list(islice(field_centres(), math.ceil(extra / FIELD)))
    new_mirrors, new_monuments, new_targets = {}, {}, {}
    benches: list[tuple[str, str]] = []
    for k in range(extra):
        field, place = divmod(k, FIELD)
        centre = np.array(fields[field])
        name, zp = f"ZY{119 + k}", f"ZP{119 + k}"
        angle = 2.0 * math.pi * (place + random.uniform(-0.2, 0.2)) / FIELD
        radius = RINGS[place % 2]
        x, y = (float(c + radius * along) for c, along in zip(centre, (math.cos(angle), math.sin(angle)), strict=True))
        z = random.uniform(0.0, 25.0)  # hilly ground
        towards = math.degrees(math.atan2(centre[0] - x, centre[1] - y)) % 360.0
        turn = math.remainder(math.pi - towards * DEGREE, 2.0 * math.pi)
        pattern = monuments[k % len(monuments)]
        new_monuments[name] = pattern.model_copy(
            update={
                "monument": name,
                "zp": zp,
                "x_mm": round(x / MILLIMETRE, 3),
                "y_mm": round(y / MILLIMETRE, 3),
                "z_mm": round(z / MILLIMETRE, 3),
                "azimuth_deg": round(towards, 6),
                "alpha1_rad": round(turn, 7),
                "latitude_deg": round(site.site.site.latitude_deg + y / EARTH / DEGREE, 6),
                "elevation_m": round(site.site.site.elevation_of_z0_m + z, 3),
            }
        )
        new_mirrors[zp] = mirrors[k % len(mirrors)].model_copy(update={"zp": zp})
        if place < BENCHMARKS:
            benches.append((f"B{field + 1:03d}{place + 1}", name))
            far = centre - 1.3 * (np.array([x, y]) - centre)
            new_targets[benches[-1][0]] = hollow(benches[-1][0], (*far, random.uniform(5.0, 20.0)))
    for field, (x, y) in enumerate(fields, start=1):
        for number in range(1, targets + 1):
            r, angle = 15.0 * math.sqrt(random.uniform()), random.uniform(0.0, 2.0 * math.pi)
            at = (x + r * math.cos(angle), y + r * math.sin(angle), random.uniform(5.0, 34.0))
            new_targets[f"S{field:03d}{number:02d}"] = hollow(f"S{field:03d}{number:02d}", at)
    fields_of = vars(site) | {
        "monuments": site.monuments | new_monuments,
        "mirrors": site.mirrors | new_mirrors,
        "targets": site.targets | new_targets,
    }
    grown = SiteFolder(**fields_of)
    stations = vantages_of(grown)
    certified = tuple(
        BenchmarkRow(
            target=target,
            ranger=ranger,
            certified_distance_mm=round(
                float(
                    np.linalg.norm(
                        np.array(new_targets[target].position_mm) * MILLIMETRE - stations[ranger].station.scan_point
                    )
                )
                / MILLIMETRE,
                3,
            ),
            u_mm=U_CERTIFIED_MM,
        )
        for target, ranger in benches
    )
    return SiteFolder(**(fields_of | {"benchmarks": (*site.benchmarks, *certified)}))


def hollow(name: str, at: tuple[float, ...]) -> TargetRow:
    """Hollow retroreflector on the ground; `at` in m."""
    place = tuple(round(float(v) / MILLIMETRE, 1) for v in at)
    return TargetRow(name=name, type="hollow", frame="ground", position_mm=place)


def write_site(directory: Path, rangers: int, targets: int) -> None:
    """Write a generated site's folder."""
    with atomic_directory(directory) as folder:
        for name, text in site_files(large_site(rangers, targets)).items():
            file = folder / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")


class Watch:
    """Samples of a running simulation: where its loop is, and how long epochs and rounds take.

    loop     samples of the loop's thread by what it works for, waiting included, since the first round
    epochs   of each epoch: shots, parameters of the state, CPU s
    rounds   CPU s of each planned round
    """

    def __init__(self) -> None:
        self.loop: Counter[str] = Counter()
        self.epochs: list[dict[str, float]] = []
        self.rounds: list[float] = []
        self.loop_cpu_s = 0.0  # since the first round
        self._ended = threading.Event()
        self._of: int | None = None

    @contextmanager
    def __call__(self):
        """Sample until the block ends; the first thread that plans a round is the loop's."""
        solve, plan = live.solve_epoch, RoundPlanner.round

        def solved(*arguments, **options):
            begin = time.thread_time()
            epoch = solve(*arguments, **options)
            spent = time.thread_time() - begin
            row = {"shots": len(epoch.rows), "parameters": len(epoch.state.parameters), "cpu_s": round(spent, 3)}
            self.epochs.append(row)
            sys.stderr.write(f"epoch {len(self.epochs)}: {row}, {resident()} MB\n")
            return epoch

        def planned(planner, state):
            self._of = threading.get_ident()
            begin = time.thread_time()
            found = plan(planner, state)
            self.rounds.append(round(time.thread_time() - begin, 3))
            return found

        live.solve_epoch, RoundPlanner.round = solved, planned
        sampler = threading.Thread(target=self._sample, daemon=True)
        sampler.start()
        try:
            yield self
        finally:
            self._ended.set()
            sampler.join()
            live.solve_epoch, RoundPlanner.round = solve, plan

    def _sample(self) -> None:
        clock, begin = None, 0.0
        while not self._ended.wait(SAMPLED):
            if self._of is None or self._of not in (frames := sys._current_frames()):
                continue
            if clock is None:
                clock = time.pthread_getcpuclockid(self._of)
                begin = time.clock_gettime(clock)
            self.loop_cpu_s = time.clock_gettime(clock) - begin
            self.loop[part_of(frames[self._of])] += 1


def part_of(frame) -> str:
    """Part of the site that a frame of the loop works for."""
    parts = []
    while frame is not None:
        path = Path(frame.f_code.co_filename)
        if frame.f_code.co_name == "append" and path.name == "coordinator.py":
            return "journal"  # waits for the writer
        if "catseye" in path.parts:
            parts.append(path.parts[-path.parts[::-1].index("catseye")])
        frame = frame.f_back
    for name, packages in (("coordinator", ("coordinator",)), ("twin", ("ranger", "simulator"))):
        if any(package in parts for package in packages):
            return name
    return "comparison" if "gateways" in parts or "estimation" in parts else "loop"


def resident() -> int:
    """Largest resident memory of this process so far, MB."""
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6)


def journal_bytes(journal: Path) -> dict[str, int]:
    """Bytes of a journal by what they hold: samples, covariances, answers, shots without samples, the file."""
    with closing(sqlite3.connect(journal)) as connection:
        ask = {
            "samples": "SELECT sum(length(samples)) FROM buffers",
            "covariances": "SELECT sum(length(covariance)) FROM solutions",
            "answers": "SELECT sum(length(answer)) FROM solutions",
            "shots": "SELECT count(*) FROM shots",
            "commands": "SELECT sum(length(line) + length(reply)) FROM commands",
        }
        found = {name: connection.execute(text).fetchone()[0] or 0 for name, text in ask.items()}
    return {**found, "file": journal.stat().st_size}


def measure(site: Path, out: Path, minutes: float, round_s: float) -> None:
    """Simulate a site in virtual time and write what it took."""
    watch, seconds = Watch(), time.monotonic()
    cpu = time.process_time()
    with tempfile.TemporaryDirectory() as folder, watch():
        journal = Path(folder) / "site.db"
        result = catseye.simulate(site, minutes=minutes, round_s=round_s, journal=journal)
        stored = journal_bytes(journal)
    simulation = result.simulation
    out.write_text(
        json.dumps(
            {
                "rangers": simulation.totals["rangers"],
                "seconds": simulation.seconds,
                "shots": simulation.told,
                "verdict": result.verdict.text,
                "cpu_s": round(time.process_time() - cpu, 1),
                "wall_s": round(time.monotonic() - seconds, 1),
                "memory_mb": resident(),
                "epochs": watch.epochs,
                "rounds_cpu_s": watch.rounds,
                "loop_cpu_s": round(watch.loop_cpu_s, 1),
                "loop": dict(watch.loop.most_common()),
                "journal": stored,
            },
            indent=1,
        )
        + "\n",
        encoding="utf-8",
    )


def measure_writer(out: Path, shots: int) -> None:
    """Append shots with samples to an SQLite journal as fast as it takes them, and write how fast that was."""
    site = read_site_of("gbt")
    random = np.random.default_rng(1)
    wave = 8000.0 * np.sin(2.0 * math.pi * np.arange(8192) / 64.0)
    codes = [np.round(wave + 700.0 * random.standard_normal(8192)).astype(np.int16) for _ in range(64)]
    begin = 60_635 * TICKS_PER_DAY
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "site.db"
        cpu, wall = time.process_time(), time.monotonic()
        with Journal.open(place, run=Run(site, {}), clock=SystemClock()) as journal:
            for k in range(shots):
                ticks = begin + 100 * k
                shot = LiveShot("ZY105", "ZEG41040L", ticks, 128, 64, 1000, 10.0 / 32768.0, codes[k % 64], 1.5, 0.1, k)
                journal.append(AnsweredShot(shot, "used", "", 100.0, 3e-5, 0.0))
                if k % 256 == 255:
                    journal.append().result(60.0)
            journal.append().result(60.0)
        spent = {"cpu_s": time.process_time() - cpu, "wall_s": time.monotonic() - wall}
        size = place.stat().st_size
    text = json.dumps({"shots": shots, **{k: round(v, 2) for k, v in spent.items()}, "file": size}, indent=1)
    out.write_text(text + "\n", encoding="utf-8")


@dataclass(frozen=True)
class Law:
    """A power law y = a n^p through measured points."""

    a: float
    p: float

    @staticmethod
    def through(n, y) -> "Law":
        """Straight line through the logarithms; two points or more."""
        p, log_a = np.polyfit(np.log(n), np.log(y), 1)
        return Law(float(np.exp(log_a)), float(p))

    def __call__(self, n):
        return self.a * np.asarray(n, dtype=float) ** self.p

    def reaches(self, y: float) -> float:
        """The n at which it is y."""
        return (y / self.a) ** (1.0 / self.p)


@dataclass(frozen=True)
class Units:
    """What a ranger, a shot and an epoch cost, measured here.

    rate          shots a second of a ranger
    loop          CPU s of the coordinator's loop a shot: link, guard, detection, planning; without the twin
    writer        CPU s of the journal's writer a shot
    packed, row   bytes a shot in the journal: its samples, and all else
    solve         CPU s of an epoch with a state, by rangers of one coordinator
    covariance    bytes of an epoch's covariance in the journal, by rangers
    """

    rate: float
    loop: float
    writer: float
    packed: float
    row: float
    solve: Law
    covariance: Law

    @staticmethod
    def of(measured: Sequence[dict], writer: dict) -> "Units":
        """Units from measurements of sites of different size, the means weighted by shots."""
        shots = sum(m["shots"] for m in measured)
        n = [m["rangers"] for m in measured]
        loop = 0.0
        for m in measured:
            busy = {name: count for name, count in m["loop"].items() if name not in ("journal", "waiting")}
            loop += m["loop_cpu_s"] * busy.get("coordinator", 0) / max(1, sum(busy.values()))
        rest = [m["journal"]["file"] - m["journal"]["samples"] - m["journal"]["covariances"] for m in measured]
        late = [[e["cpu_s"] for e in m["epochs"][2:]] or [m["epochs"][-1]["cpu_s"]] for m in measured]
        epochs = [max(1, len(m["epochs"])) for m in measured]
        return Units(
            rate=shots / sum(m["seconds"] * m["rangers"] for m in measured),
            loop=loop / shots,
            writer=writer["cpu_s"] / writer["shots"],
            packed=sum(m["journal"]["samples"] for m in measured) / shots,
            row=sum(rest) / shots,
            solve=Law.through(n, [float(np.median(each)) for each in late]),
            covariance=Law.through(n, [m["journal"]["covariances"] / e for m, e in zip(measured, epochs, strict=True)]),
        )

    @property
    def steps(self) -> dict[str, float]:
        """Rangers at which one of each is full: half a core, so that the other half absorbs what is uneven."""
        return {
            "one SQLite writer": 0.5 / (self.writer * self.rate),
            "one event loop": 0.5 / (self.loop * self.rate),
            "one solver": self.solve.reaches(0.5 * ROUND),
        }

    def yearly(self, rangers: int, region: int) -> dict[str, float]:
        """TB a year and cores of a site that measures all the time, in regions of so many rangers."""
        regions = math.ceil(rangers / region)
        each = min(region, rangers)
        shots, epochs = self.rate * rangers * YEAR, YEAR / ROUND
        return {
            "regions": regions,
            "shots a second": self.rate * rangers,
            "samples, TB": 1e-12 * shots * RAW,
            "samples archived, TB": 1e-12 * shots * RAW * ARCHIVED,
            "journal, TB": 1e-12 * (shots * (self.packed + self.row) + epochs * regions * float(self.covariance(each))),
            "without samples, TB": 1e-12 * (shots * self.row + epochs * regions * float(self.covariance(each))),
            "cores of loops": self.loop * self.rate * rangers,
            "cores of writers": self.writer * self.rate * rangers,
            "cores of solvers": regions * float(self.solve(each)) / ROUND,
        }


def bill(measured: Sequence[Path], writer: Path, directory: Path) -> None:
    """Print the tables of the page, and draw its figure."""
    sites = sorted((json.loads(path.read_text("utf-8")) for path in measured), key=lambda m: m["rangers"])
    units = Units.of(sites, json.loads(writer.read_text("utf-8")))
    say = sys.stdout.write
    say(f"{units}\n\n| one of | is full at |\n|---|---|\n")
    for name, rangers in units.steps.items():
        say(f"| {name} | {rangers:.0f} rangers |\n")
    region = REGION
    plans = {n: units.yearly(n, region) for n in SIZES}
    say(f"\n| a year, regions of {region} | " + " | ".join(f"{n} rangers" for n in SIZES) + " |\n")
    say("|---|" + "---|" * len(SIZES) + "\n")
    for key in plans[SIZES[0]]:
        say(f"| {key} | " + " | ".join(f"{plan[key]:.3g}" for plan in plans.values()) + " |\n")
    for name, kept in (("all samples", 1.0), ("samples of a tenth", 0.1), ("no samples", 0.0)):
        costs = []
        for plan in plans.values():
            stored = YEARS * (kept * plan["samples archived, TB"] + plan["without samples, TB"])
            cores = plan["cores of loops"] + plan["cores of writers"] + plan["cores of solvers"]
            # what is stored grows evenly: a byte is kept for half of the time, and disks last LASTS
            disks = stored * COPIES * EUR_TB * max(1.0, 0.5 * YEARS / LASTS)
            costs.append((stored, disks, 2.0 * cores * EUR_CORE_YEAR * YEARS))
        say(f"| ten years, {name}: TB | " + " | ".join(f"{c[0]:.3g}" for c in costs) + " |\n")
        say("| disks, k€ | " + " | ".join(f"{1e-3 * c[1]:.3g}" for c in costs) + " |\n")
    say("| cores, half idle, k€ | " + " | ".join(f"{1e-3 * c[2]:.3g}" for c in costs) + " |\n")
    draw(sites, units, directory)


def draw(sites: Sequence[dict], units: Units, directory: Path) -> None:
    """Cores and bytes of one coordinator against its rangers, measured and extrapolated."""
    n = np.geomspace(10.0, 1500.0, 60)
    measured = np.array([m["rangers"] for m in sites])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.8), layout="constrained")
        left, right = figure.subplots(1, 2)
        rows = (
            ("event loop", units.loop * units.rate * n, None),
            ("journal's writer", units.writer * units.rate * n, None),
            (
                f"solver, n$^{{{units.solve.p:.1f}}}$",
                units.solve(n) / ROUND,
                [np.median([e["cpu_s"] for e in m["epochs"][2:]] or [m["epochs"][-1]["cpu_s"]]) / ROUND for m in sites],
            ),
        )
        for k, (label, cores, points) in enumerate(rows):
            left.plot(n, cores, color=SERIES[k], label=label)
            if points is not None:
                left.plot(measured, points, "o", color=SERIES[k], ms=4)
        left.axhline(0.5, color=BAD, lw=0.8)
        left.annotate("half a core: full", (10.5, 0.55), color=BAD, fontsize="x-small")
        left.set(xscale="log", yscale="log", xlabel="rangers of one coordinator", ylabel="cores")
        left.set_title("Work of one coordinator", loc="left")
        left.legend(fontsize="x-small", loc="lower right")
        lines = (
            ("samples in the journal", units.rate * n * units.packed),
            ("covariances of one coordinator", units.covariance(n) / ROUND),
            ("all else", units.rate * n * units.row),
        )
        for k, (label, rate) in enumerate(lines):
            right.plot(n, 1e-6 * rate, color=SERIES[k], label=label)
        right.plot(
            measured,
            [1e-6 * m["journal"]["covariances"] / max(1, len(m["epochs"])) / ROUND for m in sites],
            "o",
            color=SERIES[1],
            ms=4,
        )
        for axes in (left, right):
            axes.axvline(measured[-1], color=FAINT, lw=0.8)
            axes.annotate(
                " extrapolated",
                (measured[-1], 0.02),
                xycoords=("data", "axes fraction"),
                color=FAINT,
                fontsize="x-small",
            )
        right.set(xscale="log", yscale="log", xlabel="rangers of one coordinator", ylabel="MB a second")
        right.set_title("Bytes of one coordinator", loc="left")
        right.legend(fontsize="x-small", loc="upper left")
    (directory / "thousand-rangers.svg").write_text(svg(figure), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    site = commands.add_parser("site", help="write a generated site")
    site.add_argument("directory", type=Path)
    site.add_argument("--rangers", type=int, default=1000)
    site.add_argument("--targets", type=int, default=8)
    units = commands.add_parser("measure", help="simulate a site in virtual time and write what it took")
    units.add_argument("site", type=Path)
    units.add_argument("out", type=Path)
    units.add_argument("--minutes", type=float, default=1.0)
    units.add_argument("--round-s", type=float, default=ROUND)
    writer = commands.add_parser("writer", help="time the journal's writer")
    writer.add_argument("out", type=Path)
    writer.add_argument("--shots", type=int, default=2048)
    drawn = commands.add_parser("bill", help="print the tables and draw the figure")
    drawn.add_argument("directory", type=Path)
    drawn.add_argument("writer", type=Path)
    drawn.add_argument("measured", type=Path, nargs="+")
    options = parser.parse_args()
    if options.command == "site":
        write_site(options.directory, options.rangers, options.targets)
    elif options.command == "measure":
        measure(options.site, options.out, options.minutes, options.round_s)
    elif options.command == "writer":
        measure_writer(options.out, options.shots)
    else:
        bill(options.measured, options.writer, options.directory)


if __name__ == "__main__":
    main()
