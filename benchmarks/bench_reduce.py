"""Cost of the main job, from a night's samples to coordinates, beside what a user would pick instead.

python benchmarks/bench_reduce.py [--quick] [--curves]
python benchmarks/bench_reduce.py --files   what commands take of the whole dish, files and page with them
python benchmarks/bench_reduce.py --next    the same of 5000 prisms and 100 000 shots: an hour, and memory

The whole dish: 18 rangers, each prism from all six of the feed arm, 64 x 128 samples a shot; nights of more and more
prisms, each in a process of its own.
"""

import functools
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import limits
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
from harness import LIMIT, Contender, Curve, Row, main, raced, spread

EXAMPLE = Path(__file__).parents[1] / "examples" / "night-01"
SIZES = (60, 250, 500, 1000, 2209)
SPARSE_AT = 500  # prisms at which a general sparse solver is tried beside; at 2209 it takes minutes


def detection(*, quick: bool) -> Row:
    """Samples to phasors."""
    frames = np.load(EXAMPLE / "frames.npy")
    angle = 2 * np.pi * np.arange(frames.shape[1]) / 64
    cosine, sine = np.cos(angle), np.sin(angle)
    words = frames.reshape(-1).view(np.int64)
    return raced(
        "night-01, detection",
        f"{len(frames)} buffers of {frames.shape[1]} samples with uncertainty, harmonics, noise, clipping",
        {
            "catseye": Contender(lambda: detect(frames, 64)),
            "numpy, sums as written, phasor alone": Contender(lambda: (frames @ cosine, frames @ sine)),
            "numpy rfft, phasor and harmonics": Contender(lambda: np.fft.rfft(frames)),
            LIMIT: Contender(lambda: limits.read(words)),
        },
        quick=quick,
        clock=time.process_time,
    )


def adjustment(*, quick: bool) -> Iterator[Row]:
    """The network of night-01: 600 unknowns, correlated ranges; alone, and with rejection, cycles and air renewed."""
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

    size = f"{sum(len(g.observed) for g in groups)} observations, {free.sum()} unknowns"
    scipy = Contender(lambda: least_squares(whitened, x0[free], jac=jacobian, x_scale="jac"))
    yield raced(
        "night-01, one adjustment",
        f"{size}, covariance and tests",
        {
            "catseye": Contender(lambda: adjust(x0, groups, free=free)),
            "scipy least_squares, analytic Jacobian, answer alone": scipy,
        },
        quick=quick,
        clock=time.process_time,
    )
    yield raced(
        "night-01, adjustment with rejection, cycles and air",
        size,
        {
            "catseye": Contender(lambda: adjust_coordinates(campaign, phases, electronics, settings=settings)),
            "scipy least_squares, one fit of it, answer alone": scipy,
        },
        quick=quick,
        clock=time.process_time,
    )
    words = np.load(EXAMPLE / "frames.npy").reshape(-1).view(np.int64)
    yield raced(
        "night-01, samples to coordinates",
        f"campaign read, {len(campaign.shots.shot)} shots, {size}",
        {
            "catseye": Contender(lambda: reduce_epoch(read_campaign(EXAMPLE))),
            LIMIT: Contender(lambda: limits.read(words)),
        },
        quick=quick,
        clock=time.process_time,
    )


@functools.cache
def nights() -> tuple[dict[str, float], ...]:
    """Measurements of `one_night` for each size."""
    found = []
    with tempfile.TemporaryDirectory() as directory:
        for prisms in SIZES:
            run = subprocess.run(
                [sys.executable, __file__, "--one", str(prisms), str(Path(directory) / "night")],
                check=True, capture_output=True, text=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )  # fmt: skip
            found.append(json.loads(run.stdout.splitlines()[-1]))
    return tuple(found)


def rows(quick: bool) -> Iterator[Row]:
    """night-01 step by step; then the whole dish, not in quick mode."""
    yield detection(quick=quick)
    yield from adjustment(quick=quick)
    if quick:
        return
    by_size = dict(zip(SIZES, nights(), strict=True))
    some, dish = by_size[SPARSE_AT], by_size[SIZES[-1]]
    yield Row(
        path="whole dish, one step of the adjustment",
        what=f"{SPARSE_AT} prisms, {some['shots']:.0f} shots",
        ours_s=some["step"],
        beside={"scipy.sparse splu of the same normal equations": some["splu"]},
        limit_s=None,
        spread=some["step_spread"],
    )
    yield Row(
        path="whole dish, samples to coordinates",
        what=f"{SIZES[-1]} prisms, {dish['shots']:.0f} shots",
        ours_s=dish["whole"],
        beside={},
        limit_s=dish["read"],
        spread=0.0,
        note=f"processor time of one run; {dish['gb']:.2f} GB at most; adjustment and rejection {dish['settle']:.1f} s;"
        " the limit is one read of the samples",
    )


def curves(quick: bool) -> Iterator[Curve]:
    """Seconds and memory against prisms."""
    if quick:
        return
    for what, key, unit in (("18 rangers, processor time", "whole", "s"), ("18 rangers, memory", "gb", "GB")):
        values = tuple(night[key] for night in nights())
        yield Curve("whole dish, samples to coordinates", what, "prisms", SIZES, values, unit)


def one_night(prisms: int, place: Path) -> None:
    """Measure one size: processor s and GB, as a JSON line on standard output."""
    import resource

    import catseye.reduction.epoch.coordinates as coordinates
    from catseye.api.night import night
    from catseye.reduction.epoch.epoch import reduce_epoch as reduced

    shutil.rmtree(place, ignore_errors=True)
    night(place, dish_prisms=prisms, again=0.0, nature=0.0)
    took = {}
    settle = coordinates.iterate_adjustment

    def timed(*arguments, **options):
        begun = time.process_time()
        answer = settle(*arguments, **options)
        took["settle"] = time.process_time() - begun
        return answer

    coordinates.iterate_adjustment = timed
    campaign = read_campaign(place)
    reduced(read_campaign(EXAMPLE), ReductionSettings(dense_shots=0))  # kernels loaded
    before = time.process_time()
    reduction = reduced(campaign)
    took["whole"] = time.process_time() - before
    took["gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    frames = np.load(place / "frames.npy", mmap_mode="r")
    before = time.process_time()
    frames.max()
    took |= {"read": time.process_time() - before, "shots": len(campaign.shots.shot)}
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
    taken = []
    for _ in range(5):
        before = time.process_time()
        network.border.forget()
        adjust(x, groups, free=free, solver=solver)
        taken.append(time.process_time() - before)
    before = time.process_time()
    normal = sum((_gram(r, r.linear(x)[1], len(x)) for r in rows), start=csc_array((len(x), len(x))))
    moving = np.flatnonzero(free)
    splu(csc_array(normal)[:, moving][:, :][moving], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return {
        "step": float(np.median(taken)),
        "step_spread": spread(np.array(taken)),
        "splu": time.process_time() - before,
    }


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
    elif sys.argv[1:2] in (["--files"], ["--next"]):
        files_and_page(*(WHOLE if sys.argv[1] == "--files" else NEXT))
    else:
        main(rows, curves)
