"""A plan's Monte Carlo on several processes: same sums, a ledger that goes on, and failures in one line."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import catseye
from catseye.api.planning import plan
from catseye.errors import ArgumentError, EstimationError
from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.network.monte_carlo import BLOCK, Disturbance, NetworkSimulation
from catseye.estimation.network.plan import predicted
from catseye.records.network.any_file import read_network
from catseye.reduction.network.plan import chunk_object
from catseye.service.many.chunks import run_chunks
from process_scene import ends_with_us
from repository import ROOT

FEED_ARM = ROOT / "examples" / "networks" / "feed-arm.toml"


@pytest.fixture(scope="module")
def simulation():
    return NetworkSimulation.of(adjust_network(predicted(read_network(FEED_ARM))), seed=3)


def pieces(simulation, number=3):
    return [(simulation, k * BLOCK, BLOCK) for k in range(number)]


def entries(ledger):
    return {file.name: file.stat().st_mtime_ns for file in ledger.glob("runs-*.json")}


def test_a_ledger_is_continued_and_its_sums_are_the_same(simulation, tmp_path):
    ledger, told = tmp_path / "ledger", []
    direct = [chunk_object(*piece) for piece in pieces(simulation)]
    first = run_chunks(pieces(simulation), ledger=ledger, processes=2, progress=lambda *part: told.append(part))
    assert first == direct
    assert told[0] == ("Monte Carlo runs", 0, 3 * BLOCK)
    assert told[-1] == ("Monte Carlo runs", 3 * BLOCK, 3 * BLOCK)
    before = entries(ledger)
    assert set(before) == {"runs-0-24.json", "runs-25-49.json", "runs-50-74.json"}
    (ledger / "runs-25-49.json").unlink()
    assert run_chunks(pieces(simulation), ledger=ledger, processes=1, resume=True) == direct
    after = entries(ledger)
    assert {name for name in before if before[name] != after[name]} == {"runs-25-49.json"}


@pytest.mark.parametrize("changed", ["seed", "disturbance", "a coordinate", "a sigma"])
def test_another_simulation_takes_nothing_from_the_ledger(simulation, tmp_path, changed):
    ledger = tmp_path / "ledger"
    run_chunks(pieces(simulation, 1), ledger=ledger, processes=1)
    before = entries(ledger)
    network = simulation.network
    if changed == "a coordinate":
        xyz = network.points.xyz.copy()
        xyz[15, 1] += 1e-9
        network = replace(network, points=replace(network.points, xyz=xyz))
    if changed == "a sigma":
        group = network.groups[1]
        network = replace(network, groups=(network.groups[0], replace(group, covariance=group.covariance * 1.0001)))
    other = replace(simulation, network=network)
    other = replace(other, seed=4) if changed == "seed" else other
    other = replace(other, disturbance=Disturbance(common_ppm=0.1)) if changed == "disturbance" else other
    run_chunks(pieces(other, 1), ledger=ledger, processes=1, resume=True)
    assert entries(ledger) != before


def test_runs_that_cannot_be_drawn_end_in_one_line(simulation):
    group = simulation.network.groups[1]
    broken = replace(group, covariance=-np.eye(len(group.observed)))
    impossible = replace(simulation, network=replace(simulation.network, groups=(simulation.network.groups[0], broken)))
    with pytest.raises(EstimationError, match=r"Monte Carlo runs-0-24: LinAlgError: .*positive definite"):
        run_chunks(pieces(impossible, 1), processes=1)


def test_a_plan_is_the_same_on_any_number_of_processes_and_save_removes_its_ledger(tmp_path):
    here = plan(FEED_ARM, runs=200).to_object()["monte_carlo"]
    assert here["runs"] == 200
    ledger = tmp_path / "plan.ledger"
    apart = plan(FEED_ARM, runs=200, processes=2, ledger=ledger)
    assert apart.to_object()["monte_carlo"] == here
    assert entries(ledger)
    again = plan(FEED_ARM, runs=200, processes=1, ledger=ledger, resume=True)
    assert again.to_object()["monte_carlo"] == here
    catseye.save(again, tmp_path / "plan")
    assert [path.name for path in tmp_path.iterdir()] == ["plan"]


def test_resume_needs_a_ledger():
    with pytest.raises(ArgumentError, match="resume needs ledger"):
        plan(FEED_ARM, runs=100, resume=True)


@pytest.mark.slow
def test_a_plan_that_is_interrupted_goes_on(tmp_path):
    options = ["plan", str(FEED_ARM), "--runs", "100", "--blunders-percent", "2", "--processes", "2", "--json"]
    command = [sys.executable, "-c", "from catseye.cli.main import run; run()", *options]
    alone = subprocess.run(command, check=True, capture_output=True, text=True, preexec_fn=ends_with_us())
    command += ["--out", "report"]
    place, ledger = tmp_path / "here", tmp_path / "here" / "report.ledger"
    place.mkdir()
    started = subprocess.Popen(command, cwd=place, stderr=subprocess.PIPE, text=True, preexec_fn=ends_with_us())
    deadline = time.monotonic() + 120
    while not (ledger.is_dir() and entries(ledger)) and time.monotonic() < deadline:
        time.sleep(0.05)
    done = entries(ledger)
    os.kill(started.pid, signal.SIGINT)
    _, said = started.communicate(timeout=10)
    assert started.returncode == 130
    assert "of 100 runs were done; the same command with --resume continues from there" in said
    assert [path.name for path in place.iterdir()] == ["report.ledger"]
    resumed = subprocess.run(
        [*command, "--resume"], cwd=place, check=True, capture_output=True, text=True, preexec_fn=ends_with_us()
    )
    assert json.loads(resumed.stdout)["monte_carlo"] == json.loads(alone.stdout)["monte_carlo"]
    assert 0 < len(done) < 4
    assert [path.name for path in place.iterdir()] == ["report"]
