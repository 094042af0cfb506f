"""A site's history from its journal: a run of two epochs in virtual time."""

import json
import math
import shutil
import sqlite3
from contextlib import contextmanager

import numpy as np
import pytest

from catseye.api.live.watching import watch_journal
from catseye.api.surface import surface
from catseye.coordinator.journal import writer
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution, Run
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY, Happening, LivePosture, LiveWeather
from catseye.reduction.site.motion import ground_from
from catseye.service.settings import live_settings
from catseye.simulator.clock.world_clock import ManualClock
from cli.living_scene import recorded
from coordinator.ziy_scene import gbt
from journal_scene import START, PostgresServer


@pytest.fixture(scope="module")
def entries():
    """All entries of the run."""
    with JournalReader(recorded()) as reader:
        return [entry for _, entry in reader.events(1)]


@pytest.fixture(scope="module")
def watch():
    return watch_journal(recorded())


def of(entries, kind):
    return [entry for entry in entries if isinstance(entry, kind)]


def jsoned(value):
    """The value, which must be JSON."""
    return json.loads(json.dumps(value, allow_nan=False))


def test_site_has_its_runs_and_its_span(watch, entries):
    site = jsoned(watch.site())
    (run,) = site["runs"]
    last = max(p.ticks for p in of(entries, LivePosture)) / TICKS_PER_DAY
    assert (run["run"], run["started"], site["since"]) == (1, site["since"], run["started"])
    assert site["until"] == pytest.approx(run["ended"])
    assert last <= site["until"]
    assert {r["kind"] for r in site["rangers"]} == {"ground", "feed"}
    assert {"ground", "dish", "feed"} <= set(site["targets"]["body"])
    assert len({len(column) for column in site["targets"].values()}) == 1


def test_epochs_are_summaries_of_the_solutions(watch, entries):
    solutions = [s for s in of(entries, EpochSolution) if s.answer]
    rows = jsoned(watch.epochs())["epochs"]
    assert [row["number"] for row in rows] == [s.answer["number"] for s in solutions]
    for row, solution in zip(rows, solutions, strict=True):
        assert row["points"] == len(solution.answer["names"])
        assert row["variance_factor"] == solution.answer["variance_factor"]
        assert row["mjd"] == solution.answer["ticks"] / TICKS_PER_DAY
    assert [row["number"] for row in watch.epochs(limit=1)["epochs"]] == [rows[-1]["number"]]
    assert watch.epochs(until=rows[0]["mjd"])["epochs"] == [
        rows[0] | {"run": 1, "seq": watch.epochs()["epochs"][0]["seq"]}
    ]
    assert watch.epochs(since=rows[-1]["mjd"] + 1.0)["epochs"] == []


def test_epoch_has_each_points_own_covariance(watch, entries):
    solution = [s for s in of(entries, EpochSolution) if s.answer][-1]
    epoch = jsoned(watch.epoch(solution.answer["number"]))
    points, n = epoch["points"], len(solution.answer["names"])
    assert points["name"] == solution.answer["names"]
    assert np.array_equal(np.array([points[a] for a in "xyz"]).T, np.array(solution.answer["x"]))
    for key, (i, j) in {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}.items():
        own = solution.covariance[3 * np.arange(n) + i, 3 * np.arange(n) + j]
        assert np.array_equal(np.array(points["covariance"][key]), own)
    assert epoch["beams"]["shot"] == solution.answer["used"]
    assert all(w is not None for w, t in zip(epoch["beams"]["w"], epoch["beams"]["target"], strict=True) if t != "ZRG")
    zeros = dict(zip(epoch["zeros"]["ranger"], epoch["zeros"]["value"], strict=True))
    assert zeros == {name: value for name, (value, _) in solution.answer["zeros"].items()}
    rejected = {int(shot) for shot in solution.answer["rejected"]}
    assert {row["shot"] for row in epoch["rejected"]} == rejected
    assert all(row["ranger"] and row["status"] != "unknown" for row in epoch["rejected"])


def test_structure_stands_as_the_telescope_did(watch, entries):
    """The rim's middle is on the line from the elevation axis along the telescope's axis."""
    solution = [s for s in of(entries, EpochSolution) if s.answer][-1]
    lines = {line["name"]: line for line in watch.epoch(solution.answer["number"])["structure"]}
    axis = np.array([lines["elevation axis"][a] for a in "xyz"])
    azimuth = solution.answer["azimuth"]
    along = axis[:, 1] - axis[:, 0]
    right = np.array([math.cos(azimuth), -math.sin(azimuth), 0.0])  # across the azimuth, level
    assert abs(along @ right) == pytest.approx(np.linalg.norm(along))
    assert axis[2, 0] == pytest.approx(axis[2, 1])


def test_residuals_are_the_adjustments(watch, entries):
    """Against the same epoch solved again from the journal."""
    from catseye.coordinator.journal.replay import replay
    from catseye.reduction.live.live import Live

    answers = []

    class Remembering(Live):
        def accept(self, job, epoch):
            answers.append(epoch)
            return super().accept(job, epoch)

    with JournalReader(recorded()) as reader:
        settings = live_settings(reader.run().settings, "the run")
        for _ in replay(reader, 1, lambda site, _: Remembering(site, settings)):
            pass
    epoch, number = answers[-1], len(answers)
    ranges = epoch.coordinates.ranges
    by_shot = {epoch.rows[k].shot.number: row for row, k in enumerate(ranges.shot.tolist())}
    table = jsoned(watch.residuals(number))
    assert table["by"] == "adjustment"
    rows = [k for k, shot in enumerate(table["shot"]) if shot in by_shot]
    assert len(rows) == len(by_shot)
    for k in rows:
        at = by_shot[table["shot"][k]]
        assert (table["ranger"][k], table["target"][k]) == (ranges.ranger[at], ranges.target[at])
        assert table["residual"][k] == pytest.approx(ranges.residual[at], abs=1e-15)
        assert table["w"][k] == pytest.approx(ranges.standardised[at])
        assert -math.pi / 2 < table["elevation"][k] < math.pi / 2


def test_journal_without_stored_ranges_gives_residuals_by_prediction(tmp_path):
    """Residuals of an earlier version: each shot's range less its prediction."""
    path = tmp_path / "old.db"
    shutil.copy(recorded(), path)
    with sqlite3.connect(path) as connection:
        connection.execute("DELETE FROM documents WHERE name = 'epoch-ranges'")
    connection.close()
    watch = watch_journal(path)
    number = watch.epochs()["epochs"][-1]["number"]
    table = jsoned(watch.residuals(number))
    shots = watch.shots(epoch=number)
    misfits = dict(zip(shots["number"], shots["misfit"], strict=True))
    assert table["by"] == "prediction"
    assert table["residual"] == [misfits[shot] for shot in table["shot"]]
    assert set(table["w"]) == {None}
    assert set(watch.epoch(number)["beams"]["w"]) == {None}
    assert watch.shot(table["shot"][0])["correction"][1]["name"] == "range by this shot alone"


def test_chain_of_a_shot_ends_in_its_range(watch):
    """The sum of the chain against the shot's own range, which had the corrections of the epoch before."""
    number = watch.epochs()["epochs"][-1]["number"]
    table, compared = watch.residuals(number), 0
    for shot in table["shot"][::7]:
        detail = jsoned(watch.shot(shot))
        chain = {step["name"]: step["value"] for step in detail["correction"]}
        if detail["status"] != "used" or "optical length" not in chain:
            continue
        assert detail["epoch"] == number
        assert chain["range"] == pytest.approx(detail["range"], abs=3e-3)
        whole = chain["whole half wavelengths"] * chain["half wavelength in vacuum"]
        assert 0.0 <= whole - chain["optical length"] < chain["half wavelength in vacuum"]
        assert chain["vacuum to air"] < 0.0
        compared += 1
    assert compared > 3


def test_shot_has_weather_posture_and_certificate_of_its_time(watch, entries):
    shot = of(entries, AnsweredShot)[-10].shot
    detail = jsoned(watch.shot(shot.number))
    before = [p for p in of(entries, LivePosture) if p.ticks <= shot.ticks][-1]
    assert (detail["ranger"], detail["target"], detail["has_samples"]) == (shot.ranger, shot.target, True)
    assert detail["posture"]["azimuth"] == before.azimuth
    reads = [w for w in of(entries, LiveWeather) if w.ticks <= shot.ticks]
    assert {w["station"]: w["temperature_c"] for w in detail["weather"]} == {r.station: r.temperature_c for r in reads}
    assert detail["certificate"]["file"].startswith("mirrors/")
    assert len(detail["certificate"]["sha256"]) == 64
    with pytest.raises(InputError, match="is not in run 1"):
        watch.shot(10**6)


def test_samples_are_the_buffers_with_what_was_detected(watch, entries):
    answered = next(a for a in of(entries, AnsweredShot) if a.status == "used")
    shot, table = answered.shot, jsoned(watch.samples(answered.shot.number))
    assert np.allclose(table["volts"], shot.samples * shot.volts_per_code, atol=1e-7)
    assert table["sample_rate_hz"] == shot.if_hz * shot.samples_per_cycle
    first = table["harmonics"][0]
    assert (first["n"], first["frequency_hz"]) == (1, shot.if_hz)
    at = table["spectrum"]["frequency_hz"].index(pytest.approx(shot.if_hz))
    assert table["spectrum"]["amplitude_v"][at] == pytest.approx(first["amplitude_v"])  # another way to the same
    assert table["fit"]["amplitude_v"] == first["amplitude_v"]
    assert len(table["cycle_phase"]["phase"]) == len(table["cycle_phase"]["t"]) == shot.cycles
    difference = np.angle(np.exp(1j * (np.array(table["cycle_phase"]["phase"]) - table["fit"]["phase"])))
    assert abs(difference.mean()) < 5.0 * table["fit"]["u_phase"] + 1e-3


def test_shots_are_chosen_by_ranger_target_status_epoch_and_time(watch, entries):
    answered = of(entries, AnsweredShot)
    everything = jsoned(watch.shots(limit=20_000))
    assert everything["number"] == [a.shot.number for a in answered]
    assert everything["range"] == [None if math.isnan(a.range_) else a.range_ for a in answered]
    ranger = answered[3].shot.ranger
    assert watch.shots(ranger=ranger, limit=20_000)["number"] == [
        a.shot.number for a in answered if a.shot.ranger == ranger
    ]
    assert set(watch.shots(status="reference")["target"]) == {"ZRG"}
    assert watch.shots(limit=7)["number"] == [a.shot.number for a in answered[-7:]]
    middle = answered[len(answered) // 2].shot.ticks / TICKS_PER_DAY
    assert watch.shots(since=middle, limit=20_000)["number"] == [
        a.shot.number for a in answered if a.shot.ticks / TICKS_PER_DAY >= middle
    ]
    assert watch.shots(until=middle, limit=20_000)["number"] == [
        a.shot.number for a in answered if a.shot.ticks / TICKS_PER_DAY <= middle
    ]
    last = watch.epochs()["epochs"][-1]
    assert len(watch.shots(epoch=last["number"], limit=20_000)["number"]) >= last["shots"]


def test_state_of_the_past_is_what_was_known_then(watch, entries):
    answered = of(entries, AnsweredShot)
    ticks = answered[len(answered) // 2].shot.ticks
    state = jsoned(watch.state(ticks / TICKS_PER_DAY))
    before = {a.shot.ranger: a for a in answered if a.shot.ticks <= ticks}
    assert state["source"] == "journal"
    for row in state["rangers"]:
        own = before.get(row["name"])
        assert (row["last"] is None) == (own is None)
        if own is not None:
            assert row["last"]["number"] == own.shot.number
    assert state["posture"]["mjd"] <= ticks / TICKS_PER_DAY
    assert (state["mode"], state["connected"]) == ("active", True)
    assert jsoned(watch.state())["word"] == "stopped"
    assert jsoned(watch.state(watch.site()["since"] - 1.0))["epoch"] is None


def test_events_are_those_of_the_journal(watch, entries):
    told = [h for h in of(entries, Happening) if h.severity != "debug"]
    table = jsoned(watch.events())
    assert list(zip(table["who"], table["kind"], table["text"], strict=True)) == [(h.who, h.kind, h.text) for h in told]
    assert table["mjd"] == [h.ticks / TICKS_PER_DAY for h in told]
    assert len(watch.events(severity="debug", limit=20_000)["mjd"]) == len(of(entries, Happening))
    assert watch.events(limit=2)["text"] == [h.text for h in told[-2:]]


def test_series_of_each_kind(watch, entries):
    names = [row["name"] for row in jsoned(watch.series_names())["names"]]
    kinds = {name.partition(":")[0] for name in names}
    assert kinds == {
        *("range", "correction", "amplitude", "zero", "temperature", "pressure", "humidity"),
        *("azimuth", "elevation", "refractivity", "variance_factor", "point"),
    }
    one_of_each = [next(name for name in names if name.partition(":")[0] == kind) for kind in sorted(kinds)]
    rows = {row["name"]: row for row in jsoned(watch.series(one_of_each))["names"]}
    assert all(row["mjd"] for row in rows.values())
    assert all(row["mjd"] == sorted(row["mjd"]) for row in rows.values())
    postures = of(entries, LivePosture)
    assert rows["azimuth"]["value"] == [p.azimuth for p in postures]
    name = next(name for name in one_of_each if name.startswith("point:"))
    point, _, axis = name.removeprefix("point:").rpartition(":")
    answers = [s.answer for s in of(entries, EpochSolution) if s.answer and point in s.answer["names"]]
    assert rows[name]["value"] == [a["x"][a["names"].index(point)]["xyz".index(axis)] for a in answers]
    with pytest.raises(InputError, match="is not a series"):
        watch.series(["nothing"])
    with pytest.raises(InputError, match="most = 1"):
        watch.series(["azimuth"], most=1)


def test_long_series_are_bins_that_keep_extremes_and_the_mean(watch, entries):
    line = next(n for n in (row["name"] for row in watch.series_names()["names"]) if n.startswith("amplitude:"))
    full = watch.series([line])["names"][0]
    few = jsoned(watch.series([line], most=5))["names"][0]
    assert len(few["mjd"]) <= 5 < len(full["mjd"])
    assert min(few["low"]) == min(full["value"])
    assert max(few["high"]) == max(full["value"])
    assert all(lo <= v <= hi for lo, v, hi in zip(few["low"], few["value"], few["high"], strict=True))


def test_point_has_its_epochs_with_covariance_and_shots(watch, entries):
    solutions = [s for s in of(entries, EpochSolution) if s.answer]
    name = solutions[-1].answer["names"][5]
    table = jsoned(watch.point(name))
    own = [(s, s.answer["names"].index(name)) for s in solutions if name in s.answer["names"]]
    assert table["epoch"] == [s.answer["number"] for s, _ in own]
    assert table["x"] == [s.answer["x"][k][0] for s, k in own]
    assert table["covariance"]["yz"] == [s.covariance[3 * k + 1, 3 * k + 2] for s, k in own]
    assert all(name in (r, t) for r, t in zip(table["shots"]["ranger"], table["shots"]["target"], strict=True))
    with pytest.raises(InputError, match="is not a point"):
        watch.point("NOWHERE")


def test_nothing_is_dropped_after_the_last_event(watch):
    """A page by another clock asks so, before it knows the site's."""
    table = jsoned(watch.dropped(since=watch.dropped()["bins"][-1] + 1000.0, bins=4))
    assert len(table["bins"]) == 4
    assert not any(map(sum, (*table["good"], *table["failed"])))


def test_dropped_counts_every_shot_once(watch, entries):
    table = jsoned(watch.dropped(bins=10))
    answered = of(entries, AnsweredShot)
    good = sum(a.status in ("used", "reference") for a in answered)
    assert np.sum(table["good"]) == good
    assert np.sum(table["failed"]) == len(answered) - good
    assert (len(table["bins"]), len(table["rangers"])) == (10, len(table["good"]))


def test_ranger_has_zero_commands_and_certificates(watch, entries):
    name = of(entries, AnsweredShot)[0].shot.ranger
    row = jsoned(watch.ranger(name))
    assert row["zero"]["epoch"] == watch.epochs()["epochs"][-1]["number"]
    assert row["commands"]["line"]
    assert not any(line.startswith("VER") for line in row["commands"]["line"])
    assert row["certificates"][0]["instrument"] == row["station"]["mirror"]
    with pytest.raises(InputError, match="is not a ranger here"):
        watch.ranger("ZY999")


def test_calibrations_are_the_records(watch):
    rows = jsoned(watch.calibrations())["instruments"]
    mirrors = [row for row in rows if row["kind"] == "mirror"]
    record = watch.map.site.mirrors[mirrors[0]["instrument"]]
    assert (mirrors[0]["value"], mirrors[0]["unit"]) == (pytest.approx(record.d0_mm * 1e-3), "m")
    assert {row["kind"] for row in rows} >= {"site", "monument", "mirror"}


def test_air_names_the_paths_and_the_stations(watch):
    table = jsoned(watch.air())
    assert len(table["paths"]["ranger"]) == len(table["paths"]["refractivity_ppm"]) > 5
    assert all(200.0 < value < 320.0 for value in table["paths"]["refractivity_ppm"])
    assert all(station["read"] for station in table["stations"])


def test_comparison_of_an_epoch_with_itself_moves_nothing(watch):
    number = watch.epochs()["epochs"][-1]["number"]
    table = jsoned(watch.comparison(number, number))
    assert max(abs(value) for axis in ("dx", "dy", "dz") for value in table[axis]) < 1e-9
    assert not any(table["significant"])
    assert table["verdict"] == "good"
    pair = jsoned(watch.comparison(number - 1, number))
    assert len(pair["name"]) == len(pair["w"]) > 5
    with pytest.raises(InputError, match="epoch 99 is not in run 1"):
        watch.comparison(1, 99)


def test_surface_of_an_epoch_without_covariance_is_empty_and_says_why(tmp_path):
    path = tmp_path / "no-covariance.db"
    shutil.copy(recorded(), path)
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE solutions SET covariance = NULL, size = 0")
    connection.close()
    watch = watch_journal(path)
    number = watch.epochs()["epochs"][-1]["number"]
    surface = jsoned(watch.surface(number))
    assert (surface["points"]["name"], surface["zernike"], surface["rms"]) == ([], [], None)
    assert (surface["verdict"], surface["verdict_text"]) == ("failed", "no prism of the dish has a covariance")
    assert set(watch.epoch(number)["points"]["covariance"]["xx"]) == {None}


@contextmanager
def written(path, **settings):
    """A new journal of the recorded run, without entries."""
    with JournalReader(recorded()) as reader:
        run = Run(reader.site(1), reader.run().settings)
        clock = ManualClock(reader.run().started / TICKS_PER_DAY)
        with Journal.open(path, run=run, clock=clock, settings=JournalSettings(**settings)) as journal:
            yield journal


def test_surface_needs_prisms(watch):
    surface = jsoned(watch.surface())
    assert (surface["points"]["name"], surface["verdict"]) == ([], "failed")
    assert "needs 6 points, 5 given" in surface["verdict_text"]


def test_surface_is_that_of_the_recipe(tmp_path):
    """Against `catseye.surface` with the same prisms and their joint covariance: a dish with a bump and noise."""
    site, rng, posture = gbt(), np.random.default_rng(9), (2.5, 0.7)
    names = sorted(n for n, t in site.targets.items() if t.shapes_dish)[::40]
    local = np.array([site.targets[n].position_mm for n in names]) * 1e-3
    local[:, 2] += 1e-3 * np.exp(-((local[:, 0] / 20.0) ** 2)) + 5e-5 * rng.standard_normal(len(names))
    places = ground_from(site, "reflector", *posture).single.points(local)
    root = rng.standard_normal((3 * len(names), 3 * len(names))) * 1e-5
    covariance = root @ root.T / len(names) + 2.5e-9 * np.eye(3 * len(names))
    answer = {"number": 1, "ticks": START, "azimuth": posture[0], "elevation": posture[1], "names": names}
    clock = ManualClock(START / TICKS_PER_DAY)
    with Journal.open(tmp_path / "dish.db", run=Run(site), clock=clock) as journal:
        journal.append(EpochSolution(START, answer | {"x": places.tolist(), "used": [], "rejected": {}}, covariance))
        journal.append().result(30.0)
    table = jsoned(watch_journal(tmp_path / "dish.db").surface())
    degrees = dict(zip(("azimuth_deg", "elevation_deg"), np.degrees(posture).tolist(), strict=True))
    whole = surface(points=places, covariance=covariance, names=names, site=site, frame="ground", **degrees)
    assert tuple(table["points"]["name"]) == whole.names
    assert table["points"]["deviation"] == pytest.approx(whole.deviations.tolist(), abs=1e-12)
    assert table["points"]["u"] == pytest.approx(whole.u.tolist())
    assert table["focal_length"] == pytest.approx(whole.focal_length)
    terms = whole.tables()["zernike"]
    assert [term["value"] for term in table["zernike"]] == pytest.approx(terms["value"].to_value("m").tolist())
    assert [term["u"] for term in table["zernike"]] == pytest.approx(terms["u"].to_value("m").tolist())
    assert table["actuators"]["name"] == names
    assert np.abs(np.array(table["actuators"]["value"]) + whole.deviations).max() < 2e-4  # each undoes its own error


def test_journal_that_is_written_is_watched(tmp_path, entries):
    """Events appear as they become durable; the file need not be closed."""
    half = len(entries) // 2
    with written(tmp_path / "live.db") as journal:
        for entry in entries[:half]:
            journal.append(entry)
        journal.append().result(30.0)
        watch = watch_journal(tmp_path / "live.db")
        assert len(watch.shots(limit=20_000)["number"]) == len(of(entries[:half], AnsweredShot))
        for entry in entries[half:]:
            journal.append(entry)
        journal.append().result(30.0)
        assert len(watch.shots(limit=20_000)["number"]) == len(of(entries, AnsweredShot))
        assert len(watch.epochs()["epochs"]) == len([s for s in of(entries, EpochSolution) if s.answer])


def test_run_in_several_files_is_one(tmp_path, entries, monkeypatch):
    """Rotated again and again: all answers are the same."""
    monkeypatch.setattr(writer, "LOOK", 0.0)
    path, whole = tmp_path / "parts.db", watch_journal(recorded())
    with written(path, rotate_bytes=1_000_000) as journal:
        for k, entry in enumerate(entries):
            journal.append(entry)
            if k % 100 == 99:
                journal.append().result(30.0)
    watch = watch_journal(path)
    assert len(sorted(tmp_path.glob("parts*.db"))) > 2
    assert watch.shots(limit=20_000) == whole.shots(limit=20_000)
    number = whole.epochs()["epochs"][-1]["number"]
    assert watch.epoch(number)["points"] == whole.epoch(number)["points"]
    assert watch.residuals(number) == whole.residuals(number)
    assert watch.dropped(bins=5)["good"] == whole.dropped(bins=5)["good"]
    assert watch.samples(1)["volts"] == whole.samples(1)["volts"]
    at = whole.epochs()["epochs"][0]["mjd"]
    assert watch.state(at)["rangers"] == whole.state(at)["rangers"]


@pytest.fixture(scope="module")
def server():
    """A PostgreSQL server, where one is installed."""
    pytest.importorskip("psycopg", reason="psycopg is not installed: the extra catseye[postgresql]")
    try:
        made = PostgresServer()
    except FileNotFoundError as problem:
        pytest.skip(str(problem))
    yield made
    made.stop()


def test_journal_of_a_server_gives_the_same_answers(server, entries, watch):
    place = server.database("watched")
    with written(place) as journal:
        for entry in entries:
            journal.append(entry)
        journal.append().result(60.0)
    other = watch_journal(place)
    number = watch.epochs()["epochs"][-1]["number"]
    names = [row["name"] for row in watch.series_names()["names"]]
    kinds = sorted({name.partition(":")[0] for name in names})
    chosen = [next(name for name in names if name.partition(":")[0] == kind) for kind in kinds]
    at = watch.epochs()["epochs"][0]["mjd"]
    point = watch.epoch(number)["points"]["name"][5]
    for answer in (
        lambda w: w.shots(limit=20_000),
        lambda w: w.shots(ranger="ZY101", status="used"),
        lambda w: w.epoch(number),
        lambda w: w.residuals(number),
        lambda w: w.series_names(),
        lambda w: w.series(chosen),
        lambda w: w.dropped(bins=7)["good"],
        lambda w: w.point(point),
        lambda w: w.ranger("ZY101", at)["commands"],
        lambda w: w.state(at)["rangers"],
        lambda w: w.samples(3)["volts"],
        lambda w: w.events(severity="debug"),
    ):
        assert jsoned(answer(other)) == jsoned(answer(watch))
    for few, same in zip(other.series(chosen, most=5)["names"], watch.series(chosen, most=5)["names"], strict=True):
        assert few["value"] == pytest.approx(same["value"])
        assert few["low"] == same["low"]
    assert (
        other.dropped(since=at - 1.0, until=at + 1.0)["good"] == watch.dropped(since=at - 1.0, until=at + 1.0)["good"]
    )


def test_missing_journal_is_refused_and_a_site_waits_for_it(tmp_path):
    with pytest.raises(InputError, match="is missing"):
        watch_journal(tmp_path / "none.db")


@pytest.mark.parametrize("call", [lambda w: w.command("MODE", [], "anna"), lambda w: w.acknowledge("mode", "anna")])
def test_journal_takes_no_commands(watch, call):
    import asyncio

    with pytest.raises(InputError, match="a journal takes no commands"):
        asyncio.run(call(watch))
