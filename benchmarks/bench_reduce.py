"""What the main job costs, beside what a user would pick instead; ratios of one run, medians of rounds.

python benchmarks/bench_reduce.py           all of it
python benchmarks/bench_reduce.py --files   what commands take of the whole dish, files and page with them
python benchmarks/bench_reduce.py --next    the same of 5000 prisms and 100 000 shots: an hour, and memory
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.coordinates import adjust_coordinates
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.ranges import follow_electronics, measure_phases
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.shots import shot_group
from catseye.reduction.epoch.unknowns import build_network
from catseye.signal.detection.phase import detect

ROUNDS = 5
EXAMPLE = Path(__file__).parents[1] / "examples" / "night-01"


def seconds(work: Callable[[], object]) -> float:
    """Median wall time of a few rounds."""
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def show(rows: list[tuple[str, float]], ours: str) -> None:
    """A table of times and of ratios to ours."""
    base = dict(rows)[ours]
    for name, t in rows:
        sys.stdout.write(f"  {name:<58} {t * 1e3:9.1f} ms {t / base:8.1f} x\n")
    sys.stdout.write("\n")


def detection() -> None:
    """Samples to phasors."""
    frames = np.load(EXAMPLE / "frames.npy")
    angle = 2 * np.pi * np.arange(frames.shape[1]) / 64
    cosine, sine = np.cos(angle), np.sin(angle)
    size = frames.nbytes / 1e6
    sys.stdout.write(f"Detection of {len(frames)} buffers of {frames.shape[1]} samples ({size:.0f} MB)\n")
    ours = "catseye detect: phasor, uncertainty, harmonics, noise, clipping"
    show(
        [
            (ours, seconds(lambda: detect(frames, 64))),
            ("numpy sums of eq. 5.1 and 5.2: phasor alone", seconds(lambda: (frames @ cosine, frames @ sine))),
            ("numpy rfft: phasor and harmonics", seconds(lambda: np.fft.rfft(frames))),
            ("one read of the samples (the limit)", seconds(lambda: frames.max())),
        ],
        ours,
    )


def adjustment() -> None:
    """The network of night-01: 600 unknowns, correlated ranges."""
    campaign, settings = read_campaign(EXAMPLE), ReductionSettings()
    phases = measure_phases(campaign, settings)
    electronics, _ = follow_electronics(campaign, phases)
    network = build_network(campaign, phases, electronics, settings=settings)
    x0 = np.array(network.layout.start)
    free = np.array(network.layout.free)
    groups = [shot_group(network, name, x0)[0] for name in network.rangers] + network.priors
    factors = [np.linalg.cholesky(g.covariance) if g.covariance.ndim == 2 else np.sqrt(g.covariance) for g in groups]

    def whitened(y: np.ndarray) -> np.ndarray:
        x = x0.copy()
        x[free] = y
        parts = []
        for group, factor in zip(groups, factors, strict=True):
            v = group.observed - group.predict(x)[0]
            parts.append(np.linalg.solve(factor, v) if factor.ndim == 2 else v / factor)
        return np.concatenate(parts)

    def jacobian(y: np.ndarray) -> np.ndarray:
        x = x0.copy()
        x[free] = y
        rows = []
        for group, factor in zip(groups, factors, strict=True):
            full = -full_jacobian(group, x)
            rows.append(np.linalg.solve(factor, full) if factor.ndim == 2 else full / factor[:, None])
        return np.concatenate(rows)[:, free]

    sys.stdout.write(f"Adjustment of {sum(len(g.observed) for g in groups)} observations, {free.sum()} unknowns\n")
    ours = "catseye adjust: answer, covariance, every test statistic"
    with threadpool_limits(limits=1, user_api="blas"):
        show(
            [
                (ours, seconds(lambda: adjust(x0, groups, free=free))),
                (
                    "the same with rejection, cycles and air renewed",
                    seconds(lambda: adjust_coordinates(campaign, phases, electronics, settings=settings)),
                ),
                (
                    "scipy least_squares, analytic Jacobian: answer alone",
                    seconds(lambda: least_squares(whitened, x0[free], jac=jacobian, x_scale="jac")),
                ),
            ],
            ours,
        )


def whole() -> None:
    """The main job without its report."""
    sys.stdout.write("The main job: campaign read, samples to coordinates, pose, surface\n")
    ours = "read_campaign and reduce_epoch"
    show([(ours, seconds(lambda: reduce_epoch(read_campaign(EXAMPLE))))], ours)


SIZES = (60, 120, 250, 500, 1000, 2209)
SPARSE_AT = 500  # prisms at which a general sparse solver is tried beside; at 2209 it takes minutes


def whole_dish() -> None:
    """Nights of more and more prisms, each in a process of its own: seconds and memory from samples to coordinates."""
    sys.stdout.write(
        "The whole dish: 18 rangers, each prism from all six of the feed arm, 64 x 128 samples a shot\n"
        "  prisms  shots    read   samples to  of which          memory  border  beside one read\n"
        "                 samples  coordinates  adjustment, rejection          of the samples\n"
    )
    told = []
    with tempfile.TemporaryDirectory() as directory:
        for prisms in (*SIZES, -2209):  # the last: 20 000 shots
            place = Path(directory) / "night"
            run = subprocess.run(
                [sys.executable, __file__, "--one", str(prisms), str(place)],
                check=True, capture_output=True, text=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )  # fmt: skip
            told.append(json.loads(run.stdout.splitlines()[-1]))
            one = told[-1]
            sys.stdout.write(
                f"  {abs(prisms):6d} {one['shots']:6d} {one['read']:7.2f} s {one['whole']:9.2f} s"
                f" {one['settle']:9.2f} s {one['gb']:13.2f} GB {one['border']:7d} {one['whole'] / one['read']:8.0f} x\n"
            )
            if prisms == SPARSE_AT:
                sys.stdout.write(
                    f"         one step of it by scipy.sparse (splu of the same normal equations) "
                    f"{one['splu']:.2f} s, {one['splu'] / one['step']:.1f} x our {one['step']:.2f} s\n"
                )
    size, seconds_, memory = (np.log([t[k] for t in told[: len(SIZES)]]) for k in ("prisms", "whole", "gb"))
    sys.stdout.write(
        f"  exponent against prisms from {SIZES[0]} to {SIZES[-1]}: time {np.polyfit(size, seconds_, 1)[0]:.2f}, "
        f"memory {np.polyfit(size, memory, 1)[0]:.2f}\n\n"
    )


def one_night(prisms: int, place: Path) -> None:
    """One size of `whole_dish`; prints a JSON line."""
    import resource

    import catseye.reduction.epoch.coordinates as coordinates
    from catseye.api.night import night
    from catseye.reduction.epoch.epoch import reduce_epoch as reduced

    if prisms != SIZES[0] or not place.exists():
        import shutil

        shutil.rmtree(place, ignore_errors=True)
        night(place, dish_prisms=abs(prisms), again=0.43 if prisms < 0 else 0.0, nature=0.0)
    took = {}
    settle = coordinates.iterate_adjustment

    def timed(*given, **options):
        begun = time.perf_counter()
        answer = settle(*given, **options)
        took["settle"] = time.perf_counter() - begun
        return answer

    coordinates.iterate_adjustment = timed
    campaign = read_campaign(place)
    reduced(read_campaign(EXAMPLE), ReductionSettings(dense_shots=0))  # kernels loaded
    before = time.perf_counter()
    reduction = reduced(campaign)
    took["whole"] = time.perf_counter() - before
    took["gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    q = getattr(reduction.coordinates.joint.q, "inner", None)  # beneath the common errors
    took["border"] = len(q.eliminated.blocks.outer) if hasattr(q, "eliminated") else 0
    frames = np.load(place / "frames.npy", mmap_mode="r")
    before = time.perf_counter()
    frames.max()
    took |= {"read": time.perf_counter() - before, "prisms": abs(prisms), "shots": len(campaign.shots.shot)}
    if prisms == SPARSE_AT:
        took |= one_step(campaign, reduction)
    sys.stdout.write(json.dumps(took) + "\n")


def one_step(campaign, reduction) -> dict[str, float]:
    """One Gauss-Newton step of the same system: eliminated by blocks, and by a general sparse factorisation."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    from catseye.estimation.least_squares.adjustment import SolverSettings
    from catseye.estimation.least_squares.normal import _gram
    from catseye.estimation.least_squares.rows import ActiveRows

    settings = ReductionSettings(dense_shots=0)
    electronics, _ = follow_electronics(campaign, reduction.phases, 0)
    network = build_network(campaign, reduction.phases, electronics, settings=settings)
    x, free = np.array(network.layout.start), np.array(network.layout.free)
    groups = [shot_group(network, name, x)[0] for name in network.rangers] + network.priors
    rows = [ActiveRows.of(g) for g in groups]
    solver = SolverSettings(iterations=1, tests=False, border=network.border)
    ours = seconds(lambda: (network.border.forget(), adjust(x, groups, free=free, solver=solver)))
    before = time.perf_counter()
    normal = sum((_gram(r, r.linear(x)[1], len(x)) for r in rows), start=csc_array((len(x), len(x))))
    moving = np.flatnonzero(free)
    splu(csc_array(normal)[:, moving][:, :][moving], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return {"step": ours, "splu": time.perf_counter() - before}


WHOLE, NEXT = (2209, 0.43, 8.0), (5000, 2.15, 4.8)  # prisms, how often each is shot again, s between two shots


def used(arguments: list[str]) -> tuple[float, float, float, str]:
    """Processor time (s), wall time (s) and peak memory (GB) of a command of its own, and why it failed, if so."""
    begun = time.perf_counter()
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "catseye", *arguments], stdout=subprocess.DEVNULL, stderr=said,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        _, status, usage = os.wait4(process.pid, 0)
        said.seek(0)
        lines = said.read().strip().splitlines()
    wall, code = time.perf_counter() - begun, os.waitstatus_to_exitcode(status)
    why = "" if code == 0 else f"exit status {code}: {lines[-1] if lines else 'killed'}"
    return usage.ru_utime + usage.ru_stime, wall, usage.ru_maxrss / 1e6, why


def files_and_page(prisms: int, again: float, interval_s: float) -> None:
    """Commands on a whole dish: the answer alone, the answer with every file and the page, then pose and surface."""
    from catseye.api.night import night

    with tempfile.TemporaryDirectory() as directory:
        place, out = Path(directory) / "night", Path(directory) / "out"
        night(place, dish_prisms=prisms, again=again, interval_s=interval_s, nature=0.0)
        shots = len(read_campaign(place).shots.shot)
        sys.stdout.write(f"Commands of {prisms} prisms, {shots} shots      processor       wall     memory\n")
        used(["reduce", str(EXAMPLE), "--json"])  # kernels compiled
        rows = {
            "reduce --json": ["reduce", str(place), "--json"],
            "reduce --out: files and page": ["reduce", str(place), "--out", str(out)],
            "pose --group dish": ["pose", str(out), "--site", str(place), "--group", "dish", "--json"],
            "surface": ["surface", str(out), "--site", str(place), "--json"],
        }
        for name, arguments in rows.items():
            processor, wall, memory, why = used(arguments)
            sys.stdout.write(f"  {name:<40} {processor:8.1f} s {wall:8.1f} s {memory:7.2f} GB  {why}\n")
            sys.stdout.flush()
        sys.stdout.write("\n")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one_night(int(sys.argv[2]), Path(sys.argv[3]))
        sys.exit()
    if sys.argv[1:2] in (["--files"], ["--next"]):
        files_and_page(*(WHOLE if sys.argv[1] == "--files" else NEXT))
        sys.exit()
    detection()
    adjustment()
    whole()
    whole_dish()
    files_and_page(*WHOLE)
