"""A journal's runs as tables and as a campaign: nothing invented, nothing lost in silence, all or nothing."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from catseye.coordinator.journal.campaign import journal_campaign
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution, Run, SentCommand
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.errors import InputError
from catseye.gateways.journal.campaign import write_campaign
from catseye.gateways.journal.export import FORMAT, export_tables
from catseye.gateways.journal.tables import TABLES
from catseye.gateways.writers import output
from catseye.ranger.line import stamp_text
from catseye.records.night.campaign import read_campaign
from catseye.records.night.live import TICKS_PER_DAY, Happening, LivePosture, LiveShot, LiveWeather
from catseye.simulator.clock.world_clock import ManualClock
from column_scene import assert_columns
from journal_scene import START, scene_entries, scene_run, scene_shot

HALF_TICK = 0.5 / TICKS_PER_DAY
SECOND = TICKS_PER_DAY // 86_400


def written(path, entries, **more):
    with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8), **more) as journal:
        for entry in entries:
            journal.append(entry)
    return path


def rows(path):
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def epoch(ticks, covariance):
    answer = {"number": 3, "names": ["ZEG1", "ZEG2"], "x": [[1.0, 2.0, 1 / 3], [4.0, 5.0, None]], "pose": {"a": 1}}
    return EpochSolution(ticks, {**answer, "variance_factor": 1.1, "degrees_of_freedom": None}, covariance)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Two runs and what was exported of both."""
    from astropy.io import fits

    folder = tmp_path_factory.mktemp("tables")
    covariance = np.diag([1e-6, 4e-6, 9e-6, 1e-8, 1e-8, 1e-8])
    covariance[0, 1] = covariance[1, 0] = 1e-6
    entries = [*scene_entries(20), epoch(START + 7, covariance), epoch(START + 8, None)]
    written(folder / "j.db", entries)
    written(folder / "j.db", scene_entries(2, seed=9))
    with JournalReader(folder / "j.db") as reader:
        counts = export_tables(reader, folder / "out", runs=[1, 2])
    read = {}
    for name in TABLES:
        with fits.open(folder / "out" / f"{name}.fits", checksum=True) as pages:
            read[name] = (pages[1].data.copy(), pages[1].columns, pages[1].header.copy())
    return folder, entries, counts, read


def test_every_entry_is_a_row_with_its_run_seq_and_exact_time(tables):
    folder, entries, counts, _ = tables
    kinds = {"shots": AnsweredShot, "weather": LiveWeather, "postures": LivePosture, "happenings": Happening}
    for name, kind in kinds.items():
        found = rows(folder / "out" / f"{name}.csv")
        wanted = [(1, seq, e) for seq, e in enumerate(entries, 1) if isinstance(e, kind)]
        wanted += [(2, seq, e) for seq, e in enumerate(scene_entries(2, seed=9), 1) if isinstance(e, kind)]
        ticks = [e.shot.ticks if kind is AnsweredShot else e.ticks for _, _, e in wanted]
        assert [(int(r["run"]), int(r["seq"])) for r in found] == [(run, seq) for run, seq, _ in wanted]
        assert [int(r["mjd_utc"].replace(".", "")) for r in found] == ticks
        assert counts[name] == len(found) > 0
    shot = rows(folder / "out" / "shots.csv")[4]
    taken = [e for e in entries if isinstance(e, AnsweredShot)][4]
    assert (shot["ranger"], shot["target"], shot["status"]) == ("ZY105", "ZEG41040L", "used")
    assert float(shot["range_m"]) == taken.range_
    assert float(shot["phase_rad"]) == taken.shot.phase
    assert float(shot["u_range_mm"]) == pytest.approx(0.031, rel=1e-12)
    silent = [r["pressure_hpa"] for r in rows(folder / "out" / "weather.csv")[:4]]
    assert silent == ["930.86", "", "", "930.86"]


def test_fits_has_the_same_values_in_its_units(tables):
    folder, _, counts, read = tables
    for name, (data, columns, header) in read.items():
        found = rows(folder / "out" / f"{name}.csv")
        assert len(data) == counts[name] == len(found)
        assert (header["EXTNAME"], header["TIMESYS"]) == (name.upper(), "UTC")
        assert columns["DMJD"].unit == "d"
        assert data["TICKS"].tolist() == [int(r["mjd_utc"].replace(".", "")) for r in found]
        assert np.abs(data["DMJD"] - data["TICKS"] / TICKS_PER_DAY).max(initial=0.0) < 1e-11  # a double's step
    weather = read["weather"][0]
    celsius = [float(r["temperature_c"]) for r in rows(folder / "out" / "weather.csv")]
    np.testing.assert_allclose(weather["TEMPERATURE"] - 273.15, celsius, atol=1e-12)
    np.testing.assert_allclose(weather["HUMIDITY"], 0.704, rtol=1e-15)
    assert np.isnan(weather["PRESSURE"]).sum() == sum(r["pressure_hpa"] == "" for r in rows(folder / "out/weather.csv"))
    assert [read["weather"][1][n].unit for n in ("TEMPERATURE", "PRESSURE", "HUMIDITY")] == ["K", "hPa", None]
    shots, columns, _ = read["shots"]
    assert shots["RANGE"][3] == float(rows(folder / "out" / "shots.csv")[3]["range_m"])
    assert [columns[n].unit for n in ("RANGE", "U_RANGE", "PHASE", "AMPLITUDE", "IFFREQ")] == [
        "m",
        "mm",
        "rad",
        "V",
        "Hz",
    ]
    assert np.degrees(2.5) == pytest.approx(read["postures"][0]["AZIMUTH"][0], abs=1e-12)
    assert read["happenings"][0]["TEXT"][0] == "ZY105 lost \\xb5"


def test_astropy_interprets_the_units_correctly(tables):
    from astropy.table import QTable

    folder, *_ = tables
    for name in TABLES:
        table = QTable.read(folder / "out" / f"{name}.fits", format="fits")  # a unit it does not know would warn
        assert len(table) > 0


def test_coordinates_have_their_block_of_the_covariance(tables):
    folder, entries, _, read = tables
    found = rows(folder / "out" / "coordinates.csv")
    assert [(r["seq"], r["point"]) for r in found] == [
        (str(len(entries) - 1 + late), point) for late in (0, 1) for point in ("ZEG1", "ZEG2")
    ]
    one, two, bare, _ = found
    assert [float(one[key]) for key in ("x_m", "y_m", "z_m")] == [1.0, 2.0, 1 / 3]
    assert [float(one[f"u_{axis}_mm"]) for axis in "xyz"] == pytest.approx([1.0, 2.0, 3.0])
    assert [float(one[f"cov_{pair}_mm2"]) for pair in ("xy", "xz", "yz")] == pytest.approx([1.0, 0.0, 0.0])
    assert [float(two[f"u_{axis}_mm"]) for axis in "xyz"] == pytest.approx([0.1, 0.1, 0.1])
    assert (two["z_m"], bare["u_x_mm"]) == ("", "")
    assert np.isnan(read["coordinates"][0]["Z"][1])
    last = rows(folder / "out" / "solutions.csv")[-3]
    assert (last["number"], last["variance_factor"], last["degrees_of_freedom"], last["points"]) == (
        "3",
        "1.1",
        "",
        "2",
    )


def nested(name):
    """Of an answer: SI as the live reduction gives it; nothing for a null."""
    return lambda r: r[1].answer.get(name)


COLUMNS = {  # what each column says of an entry and, where an entry has more rows, of one of its points
    "shots": {
        "number": lambda r: r[1].shot.number,
        "ranger": lambda r: r[1].shot.ranger,
        "target": lambda r: r[1].shot.target,
        "cycles": lambda r: r[1].shot.cycles,
        "samples_per_cycle": lambda r: r[1].shot.samples_per_cycle,
        "if_hz": lambda r: r[1].shot.if_hz,
        "amplitude_v": lambda r: r[1].shot.amplitude,
        "phase_rad": lambda r: r[1].shot.phase,
        "status": lambda r: r[1].status,
        "text": lambda r: r[1].text,
        "range_m": lambda r: r[1].range_,
        "u_range_mm": lambda r: r[1].u_range,
        "misfit_mm": lambda r: r[1].misfit,
    },
    "weather": {
        "station": lambda r: r[1].station,
        "temperature_c": lambda r: r[1].temperature_c,
        "pressure_hpa": lambda r: 100.0 * r[1].pressure_hpa,
        "humidity_percent": lambda r: 0.01 * r[1].humidity_percent,
    },
    "postures": {
        "azimuth_deg": lambda r: r[1].azimuth,
        "elevation_deg": lambda r: r[1].elevation,
        "azimuth_rate_deg_s": lambda r: r[1].azimuth_rate,
        "elevation_rate_deg_s": lambda r: r[1].elevation_rate,
    },
    "commands": {
        "ranger": lambda r: r[1].ranger,
        "tid": lambda r: r[1].tid,
        "line": lambda r: r[1].line,
        "reply": lambda r: r[1].reply,
        "ok": lambda r: {None: "", True: "1", False: "0"}[r[1].ok],
    },
    "happenings": {
        **{name: lambda r, name=name: getattr(r[1], name) for name in ("severity", "who", "kind", "text")},
        "details": lambda r: json.dumps(r[1].details),
    },
    "solutions": {
        "number": lambda r: r[1].answer.get("number") or 0,
        "variance_factor": nested("variance_factor"),
        "degrees_of_freedom": nested("degrees_of_freedom"),
        "refractivity_ppm": lambda r: None if r[1].answer.get("refractivity_ppm") is None else 268.5e-6,
        "points": lambda r: len(r[1].answer.get("names") or ()),
        "pose": lambda r: json.dumps(r[1].answer["pose"]) if "pose" in r[1].answer else "",
    },
    "coordinates": {
        "point": lambda r: r[1].answer["names"][r[2]],
        **{f"{'xyz'[a]}_m": lambda r, a=a: r[1].answer["x"][r[2]][a] for a in range(3)},
        **{f"u_{'xyz'[a]}_mm": lambda r, a=a: r[1].covariance[3 * r[2] + a, 3 * r[2] + a] ** 0.5 for a in range(3)},
        **{
            f"cov_{'xyz'[a]}{'xyz'[b]}_mm2": lambda r, a=a, b=b: r[1].covariance[3 * r[2] + a, 3 * r[2] + b]
            for a, b in ((0, 1), (0, 2), (1, 2))
        },
    },
}
ENTRIES = {
    "shots": AnsweredShot,
    "weather": LiveWeather,
    "postures": LivePosture,
    "commands": SentCommand,
    "happenings": Happening,
    "solutions": EpochSolution,
    "coordinates": EpochSolution,
}


def test_every_column_of_every_table_has_the_unit_of_its_name(tmp_path):
    root = 1e-3 * np.random.default_rng(3).normal(size=(6, 9))
    last = epoch(START + 7_777, root @ root.T)
    last = replace(last, answer={**last.answer, "refractivity_ppm": 268.5, "degrees_of_freedom": 12.5})
    turning = LivePosture(START + 7_000, 2.5, 0.7, 1e-3, -2e-3)  # rad, rad/s
    entries = [*scene_entries(6), turning, last]
    written(tmp_path / "j.db", entries)
    with JournalReader(tmp_path / "j.db") as reader:
        export_tables(reader, tmp_path / "out", runs=[1], forms=["csv"])
    assert set(TABLES) == set(COLUMNS)
    for name, told in COLUMNS.items():
        own = [(seq, e) for seq, e in enumerate(entries, 1) if isinstance(e, ENTRIES[name])]
        if name == "coordinates":
            own = [(seq, e, point) for seq, e in own if "names" in e.answer for point in (0, 1)]
        head = {
            "run": lambda r: 1,
            "seq": lambda r: r[0],
            "mjd_utc": lambda r: stamp_text(r[1].shot.ticks if hasattr(r[1], "shot") else r[1].ticks),
        }
        silent = {"text"} if name == "shots" else set()
        assert_columns((tmp_path / "out" / f"{name}.csv").read_text("utf-8"), head | told, own, silent)


def test_the_provenance_names_journal_runs_and_every_file(tables):
    import hashlib

    folder, *_ = tables
    said = json.loads((folder / "out" / "provenance.json").read_text())
    assert (said["format"], said["journal"], sorted(said["runs"])) == (FORMAT, "j.db", ["1", "2"])
    files = {path.name for path in (folder / "out").iterdir()} - {"provenance.json"}
    assert files == {f"{name}.{form}" for name in TABLES for form in ("csv", "fits")} == set(said["outputs"])
    for name, digest in said["outputs"].items():
        assert hashlib.sha256((folder / "out" / name).read_bytes()).hexdigest() == digest


def test_runs_span_and_forms_are_chosen(tables, tmp_path):
    folder, _entries, *_ = tables
    span = (START + 200 * 5, START + 200 * 8)
    with JournalReader(folder / "j.db") as reader:
        export_tables(reader, tmp_path / "a", runs=[1], forms=["csv"], span=span)
        with pytest.raises(InputError, match="names 0 runs"):
            export_tables(reader, tmp_path / "b", runs=[1, 7])
        with pytest.raises(InputError, match="no run or no form"):
            export_tables(reader, tmp_path / "b", runs=[])
    assert [int(r["number"]) for r in rows(tmp_path / "a" / "shots.csv")] == [5, 6, 7]
    assert not list((tmp_path / "a").glob("*.fits"))
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_quantity_without_entries_is_an_empty_table(tmp_path):
    from astropy.io import fits

    written(tmp_path / "j.db", [scene_shot(1)])
    with JournalReader(tmp_path / "j.db") as reader:
        counts = export_tables(reader, tmp_path / "out", runs=[1])
    assert counts == {**dict.fromkeys(TABLES, 0), "shots": 1}
    assert (tmp_path / "out" / "happenings.csv").read_text() == "run,seq,mjd_utc,severity,who,kind,text,details\n"
    with fits.open(tmp_path / "out" / "happenings.fits") as pages:
        assert len(pages[1].data) == 0


def test_an_earlier_export_is_replaced_and_a_strangers_folder_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(output, "FORMATS", (*output.FORMATS, FORMAT))
    written(tmp_path / "j.db", campaign_entries())
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "thesis.txt").write_text("x")
    with JournalReader(tmp_path / "j.db") as reader:
        for _ in range(2):
            export_tables(reader, tmp_path / "out", runs=[1], forms=["csv"])
            export_campaign(reader, tmp_path / "campaign", run=1)
        with pytest.raises(InputError, match=r"thesis.txt"):
            export_tables(reader, tmp_path / "theirs", runs=[1])
        with pytest.raises(InputError, match="is, holds or lies in the input"):
            export_campaign(reader, tmp_path / "j.db", run=1)
    assert {path.name for path in tmp_path.iterdir()} == {"j.db", "theirs", "out", "campaign"}


# A campaign ----------------------------------------------------------------------------------------------------------


def full_shot(number, ranger="ZY105", target="ZEG41040L", *, ticks=None, **more):
    """A shot as site.toml of night-01 has it."""
    codes = np.random.default_rng(number).integers(-30000, 30000, 8192, dtype=np.int16)
    when = START + SECOND * number if ticks is None else ticks
    return replace(LiveShot(ranger, target, when, 128, 64, 1000, 10.0 / 32768.0, codes, number=number), **more)


def campaign_entries(count=6):
    entries = []
    for k in range(1, count):
        entries += [
            LivePosture(START + SECOND * k, np.radians((359.9995 + 0.001 * (k % 2)) % 360.0), np.radians(41.25)),
            full_shot(k),
            LiveWeather(f"WX{k % 2 + 1}", START + SECOND * k, 10.0 + 0.1 * k, 930.1, 70.0),
        ]
    return entries


def export_campaign(reader, out, *, run, **more):
    """Select a campaign and write it."""
    campaign = journal_campaign(reader, run, **more)
    write_campaign(campaign, out)
    return campaign


def exported(tmp_path, entries, **more):
    written(tmp_path / "j.db", entries)
    with JournalReader(tmp_path / "j.db") as reader:
        done = export_campaign(reader, tmp_path / "out", run=1, **more)
    return done, read_campaign(tmp_path / "out")


def test_export_with_jumping_postures_and_its_reduction_are_doubtful(tmp_path):
    done, campaign = exported(tmp_path, campaign_entries())
    assert done.verdict.word == "good"
    assert campaign.verdict == done.verdict
    far = [LivePosture(START + SECOND * 3 + 1, np.radians(3.0), np.radians(41.25))]
    (tmp_path / "moved").mkdir()
    done, campaign = exported(tmp_path / "moved", campaign_entries() + far)
    assert done.verdict.word == "doubtful"
    assert "the telescope moved by" in done.verdict.why
    assert campaign.verdict == done.verdict
    document = json.loads((tmp_path / "moved" / "out" / "provenance.json").read_text())
    assert document["verdict"] == done.verdict.to_object()


def test_night_is_unchanged_by_a_journal(tmp_path, night_01):
    """Every sample and reading of the example night; times to the half of a tick that a ZY's stamp has."""
    night, adc = night_01, night_01.site.adc
    shots = night.shots
    with Journal.open(
        tmp_path / "j.db", run=Run(night), clock=ManualClock(52889.125), settings=JournalSettings(compress=True)
    ) as journal:
        weather = zip(
            night.weather.mjd_utc,
            night.weather.station,
            night.weather.temperature_c,
            night.weather.pressure_hpa,
            night.weather.humidity_percent,
            strict=True,
        )
        for mjd, station, *values in weather:
            journal.append(LiveWeather(station, round(mjd * TICKS_PER_DAY), *values))
        for k in np.random.default_rng(4).permutation(len(shots)):  # a journal has them as they arrived
            size = int(shots.cycles[k] * shots.samples_per_cycle[k])
            sampling = int(shots.cycles[k]), int(shots.samples_per_cycle[k]), round(night.site.ranging.if_hz)
            ticks = round(float(shots.mjd_utc[k]) * TICKS_PER_DAY)
            samples = night.frames[shots.frame[k], :size]
            volts = adc.full_scale_volt / 32768.0
            shot = LiveShot(
                shots.ranger[k], shots.target[k], ticks, *sampling, volts, samples, number=int(shots.shot[k])
            )
            journal.append(shot)
    with JournalReader(tmp_path / "j.db") as reader:
        done = export_campaign(reader, tmp_path / "out", run=1)
    again = read_campaign(tmp_path / "out")
    assert (len(done.shots), len(done.readings), done.left_out) == (len(shots), len(night.weather), {})
    assert done.notes == ("no posture in the journal for the span: azimuth and elevation are site.toml's",)
    order = np.argsort(again.shots.shot)
    assert np.array_equal(again.shots.shot[order], np.sort(shots.shot))
    first = np.argsort(shots.shot)
    assert [again.shots.ranger[k] for k in order] == [shots.ranger[k] for k in first]
    assert [again.shots.target[k] for k in order] == [shots.target[k] for k in first]
    assert np.abs(again.shots.mjd_utc[order] - shots.mjd_utc[first]).max() <= HALF_TICK + 1e-11
    assert np.array_equal(again.frames[again.shots.frame[order]], night.frames[shots.frame[first]])
    assert np.array_equal(again.weather.temperature_c, night.weather.temperature_c)
    assert np.array_equal(again.weather.humidity_percent, night.weather.humidity_percent)
    assert again.targets == night.targets
    assert again.mirrors == night.mirrors


def test_every_column_of_a_campaign_has_the_unit_of_its_name(tmp_path):
    entries = campaign_entries()
    exported(tmp_path, entries)
    shots = [e for e in entries if isinstance(e, LiveShot)]
    readings = [e for e in entries if isinstance(e, LiveWeather)]
    told = {
        "shot": lambda k: shots[k].number,
        "mjd_utc": lambda k: stamp_text(shots[k].ticks),
        "ranger": lambda k: shots[k].ranger,
        "target": lambda k: shots[k].target,
        "cycles": lambda k: shots[k].cycles,
        "samples_per_cycle": lambda k: shots[k].samples_per_cycle,
        "frame": lambda k: k,
    }
    assert_columns((tmp_path / "out" / "shots.csv").read_text(), told, range(len(shots)))
    told = {
        "mjd_utc": lambda read: stamp_text(read.ticks),
        "station": lambda read: read.station,
        "temperature_c": lambda read: read.temperature_c,
        "pressure_mb": lambda read: 100.0 * read.pressure_hpa,
        "humidity_pct": lambda read: 0.01 * read.humidity_percent,
    }
    assert_columns((tmp_path / "out" / "weather.csv").read_text(), told, readings)


def test_live_rejections_are_exported(tmp_path):
    """A station that reads 5 °C too much for a while, and what an epoch said of three shots."""
    entries = []
    for k in range(1, 41):
        lie = 5.0 * (20 <= k < 30)
        entries += [
            full_shot(k),
            LiveWeather("WX1", START + SECOND * k, 10.0, 930.1, 70.0),
            LiveWeather("WX2", START + SECOND * k, 10.4 + lie, 930.1, 70.0),
        ]
    said = {"3": "reflected: range 3.000 mm too long", "4": "undecided: this and another", "99": "reflected: elsewhere"}
    entries.append(EpochSolution(START + SECOND * 41, {"number": 1, "rejected": said}))
    done, campaign = exported(tmp_path, entries)
    rows = (tmp_path / "out" / "doubts.csv").read_text().splitlines()
    assert rows[0] == "what,name,mjd_utc,why"
    lies = [row.split(",")[:3] for row in rows[1:-1]]
    assert lies == [["weather", "WX2", stamp_text(START + SECOND * k)] for k in range(20, 30)]
    assert "WX2 reads 15.4 C, +5.0 C from its last five minutes while the others changed by +0.0 C" in rows[1]
    assert rows[-1] == f"shot,3,{stamp_text(START + SECOND * 3)},reflected: range 3.000 mm too long"
    assert campaign.doubted == {3: "reflected: range 3.000 mm too long"}
    assert len(campaign.weather) == 70
    assert campaign.weather.temperature_c.max() == 10.4
    assert len((tmp_path / "out" / "weather.csv").read_text().splitlines()) == 81  # the record itself is whole
    assert [note.split(" was rejected")[0] for note in done.notes[:1]] == ["WX2"]
    assert "named in doubts.csv as rejected by the epochs: 1 of the shots" in done.notes


def biased(station, judgement, offset_c):
    return {station: {"judgement": judgement, "offset_c": offset_c, "u_c": 0.2}}


def with_bias(last, *answers):
    """Forty readings of both stations; WX1 reads 2 °C too much until the one before `last`."""
    entries = []
    for k in range(1, 41):
        lie = 2.0 * (k < last)
        entries += [
            full_shot(k),
            LiveWeather("WX1", START + SECOND * k, 10.0 + lie, 930.1, 70.0),
            LiveWeather("WX2", START + SECOND * k, 10.4, 930.1, 70.0),
        ]
        entries += [EpochSolution(START + SECOND * k, answer) for at, answer in answers if at == k]
    return entries


def doubted(tmp_path):
    rows = (tmp_path / "out" / "doubts.csv").read_text().splitlines()[1:]
    return [row.split(",")[1:3] for row in rows]


def test_station_biased_from_the_start_is_doubted_until_it_recovers(tmp_path):
    """Its true readings were the ones that doubts.csv named: they were doubted at their moment."""
    entries = with_bias(25, (12, {"number": 1, "biases": biased("WX1", "biased", 1.8)}))
    done, campaign = exported(tmp_path, entries)
    assert doubted(tmp_path) == [["WX1", stamp_text(START + SECOND * k)] for k in range(1, 25)]
    assert campaign.weather.temperature_c.max() == 10.4
    assert "its thermometer was biased by +1.8 °C until then" in done.notes[0]


def test_station_in_contradiction_to_the_end_is_always_doubted(tmp_path):
    entries = with_bias(99, (12, {"number": 1, "biases": biased("WX1", "biased", 1.8)}))
    _, campaign = exported(tmp_path, entries)
    assert doubted(tmp_path) == [["WX1", stamp_text(START + SECOND * k)] for k in range(1, 41)]
    assert set(campaign.weather.station) == {"WX2"}


def test_ambiguous_stations_are_not_excluded(tmp_path):
    entries = with_bias(99, (12, {"number": 1, "biases": biased("WX1", "apart", -2.4) | biased("WX2", "apart", 2.4)}))
    exported(tmp_path, entries)
    assert not (tmp_path / "out" / "doubts.csv").exists()


def test_how_far_the_telescope_shook_goes_along(tmp_path):
    """A row an epoch and body, as the epoch believed it; what no epoch of the span says is not there."""
    entries = campaign_entries()
    for k, mm in ((2, 0.25), (4, 0.375), (6, 0.5)):
        answer = {"number": k, "ticks": START + SECOND * k, "jitter_mm": {"arm": mm, "dish": 0.03125}}
        entries.append(EpochSolution(START + SECOND * k + 9, answer))
    entries.append(EpochSolution(START + SECOND * 400, {"ticks": START + SECOND * 400, "jitter_mm": {"arm": 9.0}}))
    done, campaign = exported(tmp_path, entries)
    lines = (tmp_path / "out" / "jitter.csv").read_text().splitlines()
    assert lines[0] == "mjd_utc,body,u_mm"
    told = [(stamp_text(START + SECOND * k), mm) for k, mm in ((2, 0.25), (4, 0.375), (6, 0.5))]
    assert lines[1:] == [line for t, mm in told for line in (f"{t},arm,{mm}", f"{t},dish,0.03125")]
    assert campaign.jitter.mm(float(stamp_text(START + SECOND * 3)))["arm"] == pytest.approx(0.3125, abs=1e-6)
    assert not [note for note in done.notes if "shook" in note]


def test_jitter_defaults_to_the_setting_of_the_run(tmp_path):
    run = replace(scene_run(), settings={"live": {"jitter_mm": {"arm": 0.2, "alidade": 0.03}}})
    with Journal.open(tmp_path / "j.db", run=run, clock=ManualClock(START / 1e8)) as journal:
        for entry in campaign_entries():
            journal.append(entry)
    with JournalReader(tmp_path / "j.db") as reader:
        done = export_campaign(reader, tmp_path / "out", run=1)
    first = stamp_text(START + SECOND)
    assert (tmp_path / "out" / "jitter.csv").read_text().splitlines()[1:] == [
        f"{first},alidade,0.03",
        f"{first},arm,0.2",
    ]
    assert [note for note in done.notes if "jitter.csv has the run's setting" in note]
    assert read_campaign(tmp_path / "out").jitter.mm(START / 1e8)["arm"] == 0.2


def test_invalid_jitter_is_refused(tmp_path):
    said = EpochSolution(START + SECOND * 2, {"ticks": START + SECOND * 2, "jitter_mm": {"arm": 400.0}})
    with pytest.raises(InputError, match="run 1: jitter_mm of an epoch is invalid"):
        exported(tmp_path, [*campaign_entries(), said])
    assert not (tmp_path / "out").exists()


def test_readings_are_unmarked_if_no_station_was_trusted(tmp_path):
    entries = [full_shot(k) for k in range(1, 9)]
    entries += [LiveWeather("WX1", START + SECOND * k, 10.0, 930.1, 70.0) for k in (-2700, -2690, -2680)]
    entries += [LiveWeather("WX1", START + SECOND * k, 20.0, 930.1, 70.0) for k in range(1, 9)]
    done, campaign = exported(tmp_path, entries, span=(START, START + SECOND * 60))
    assert len(campaign.weather) == 11
    assert not (tmp_path / "out" / "doubts.csv").exists()
    assert "no weather station was trusted throughout: all readings are exported unmarked" in done.notes
    assert len(done.shots) == 8


def test_campaign_posture_is_that_of_the_telescope(tmp_path):
    done, campaign = exported(tmp_path, campaign_entries())
    posture = campaign.site.campaign
    assert posture.start_mjd_utc == (START + SECOND) / TICKS_PER_DAY
    assert posture.azimuth_deg == pytest.approx(0.0005, abs=1e-9)  # the median of a telescope about north
    assert posture.elevation_deg == pytest.approx(41.25, abs=1e-12)
    assert (len(done.shots), done.notes) == (5, ())


def test_unreadable_campaign_is_not_written(tmp_path):
    """A telescope that says it looks into the ground: site.toml may not say so."""
    still = [e for e in campaign_entries() if not isinstance(e, LivePosture)]
    with pytest.raises(InputError, match="elevation_deg"):
        exported(tmp_path, [*still, LivePosture(START + SECOND * 2, 1.0, -1.0)])
    assert [path.name for path in tmp_path.iterdir()] == ["j.db"]


def test_moving_telescope_is_reported(tmp_path):
    """Its middle is the posture of site.toml, its readings are postures.csv: encoders' angles and rates in degrees."""
    moved = [LivePosture(START + SECOND * k, 1.0 + 0.01 * k, 0.5 + 0.001 * k, 0.01, 0.001) for k in (1, 2, 5)]
    still = [e for e in campaign_entries() if not isinstance(e, LivePosture)]
    done, campaign = exported(tmp_path, [*still, *moved])
    assert done.notes[0].startswith("the telescope moved by 2.292 deg")  # 0.04 rad
    assert campaign.site.campaign.azimuth_deg == pytest.approx(np.degrees(1.03))
    assert campaign.site.campaign.elevation_deg == pytest.approx(np.degrees(0.503))
    assert done.verdict.word == "good"
    told = {
        "mjd_utc": lambda read: stamp_text(read.ticks),
        "azimuth_deg": lambda read: read.azimuth,
        "elevation_deg": lambda read: read.elevation,
        "azimuth_rate_deg_s": lambda read: read.azimuth_rate,
        "elevation_rate_deg_s": lambda read: read.elevation_rate,
    }
    assert_columns((tmp_path / "out" / "postures.csv").read_text(), told, moved)
    assert [(r.ticks, r.azimuth) for r in campaign.postures] == [(r.ticks, pytest.approx(r.azimuth)) for r in moved]
    assert campaign.jitter is None


def test_shots_without_posture_of_a_moving_telescope_are_excluded(tmp_path):
    """The third is 2.5 s from both readings; how far the arm bent while it climbed is in its jitter."""
    moved = [LivePosture(START + SECOND * k, 1.0 + 0.01 * k, 0.5 + 0.002 * k, 0.01, 0.002) for k in (0, 5)]
    entries = [full_shot(k, ticks=START + SECOND * k) for k in (1, 2, 4, 5)]
    entries.append(full_shot(3, ticks=START + SECOND * 5 // 2))
    entries.sort(key=lambda shot: shot.ticks)
    entries += [LiveWeather("WX1", START + SECOND * k, 10.0, 930.1, 70.0) for k in range(6)]
    entries.append(EpochSolution(START + SECOND * 3, {"ticks": START + SECOND * 3, "jitter_mm": {"arm": 0.3}}))
    done, campaign = exported(tmp_path, [*entries, *moved])
    assert done.left_out == {"a shot without a posture within 2 s": 1}
    assert campaign.shots.shot.tolist() == [1, 2, 4, 5]
    climbed = np.degrees(0.0)  # of two readings one lies between the first shot and the last
    assert campaign.jitter.mm(START / 1e8)["arm"] == pytest.approx(np.hypot(0.3, 0.2 * climbed / np.sqrt(12.0)))


def test_unsupported_entries_are_excluded_and_reported(tmp_path):
    whole = campaign_entries()
    last = START + SECOND * 5
    strange = {
        "a shot not later than its ranger's last": full_shot(20, target="ZEG20440L", ticks=START + SECOND * 3),
        "a shot without samples": full_shot(21, samples=None),
        "a shot with samples missing": full_shot(22, cycles=127),
        "a shot of or at what the site does not have": full_shot(23, "ZY999"),
        "a shot with another if_hz or volts a code than site.toml's": full_shot(24, if_hz=2000),
        "a shot without weather within 1 h": full_shot(25, ticks=last + 3700 * SECOND),
        "a reading with a silent sensor": LiveWeather("WX1", last + 1, 10.0, float("nan"), 50.0),
        "a reading of a station that site.toml does not name": LiveWeather("WX9", last, 10.0, 930.0, 50.0),
        "a reading not later than its station's last": LiveWeather("WX1", START + SECOND * 2, 10.0, 930.0, 50.0),
        "a reading out of a thermometer's, barometer's or hygrometer's range": LiveWeather(
            "WX1", last, 10.0, 93.0, 50.0
        ),
    }
    done, campaign = exported(tmp_path, [*whole, *strange.values()])
    assert done.left_out == dict.fromkeys(strange, 1)
    assert (len(done.shots), len(campaign.shots), len(done.readings)) == (5, 5, 5)
    for reason in strange:
        assert any(note.startswith(f"left out 1: {reason} (") for note in done.notes)
    assert json.loads((tmp_path / "out" / "provenance.json").read_text())["notes"] == list(done.notes)
    assert f"(WX1 at {stamp_text(last + 1)})" in next(note for note in done.notes if "silent" in note)


def test_the_first_few_of_many_are_named(tmp_path):
    done, _ = exported(tmp_path, [*campaign_entries(), *(full_shot(k, samples=None) for k in range(30, 40))])
    assert (
        "left out 10: a shot without samples (shot 30 of ZY105, shot 31 of ZY105, shot 32 of ZY105, ...)" in done.notes
    )


def test_a_part_of_a_run(tmp_path):
    span = (START + SECOND * 2, START + SECOND * 4)
    done, campaign = exported(tmp_path, campaign_entries(), span=span)
    assert campaign.shots.shot.tolist() == [2, 3]
    assert len(done.readings) == 5  # the weather an hour around it


def test_buffers_of_different_lengths_share_one_array(tmp_path):
    short = replace(full_shot(50), cycles=64, samples=full_shot(50).samples[:4096])
    _, campaign = exported(tmp_path, [*campaign_entries(), short])
    assert np.array_equal(campaign.frames[5, :4096], short.samples)
    assert not campaign.frames[5, 4096:].any()


def test_duplicate_shot_numbers_are_replaced_by_seq(tmp_path):
    entries = campaign_entries()
    again = replace(full_shot(2, ranger="ZY106"), number=2)
    done, campaign = exported(tmp_path, [*entries, again])
    assert any("the journal's seq" in note for note in done.notes)
    assert sorted(campaign.shots.shot.tolist()) == [2, 5, 8, 11, 14, 16]


@pytest.mark.parametrize("kind", [LiveWeather, LiveShot])
def test_run_without_shots_or_weather_is_refused_without_output(tmp_path, kind):
    rest = [entry for entry in campaign_entries() if not isinstance(entry, kind)]
    with pytest.raises(InputError, match="run 1 has no"):
        exported(tmp_path, rest)
    assert [path.name for path in tmp_path.iterdir()] == ["j.db"]


def test_station_without_readings_is_removed_from_the_site(tmp_path):
    entries = [e for e in campaign_entries() if not (isinstance(e, LiveWeather) and e.station == "WX1")]
    done, campaign = exported(tmp_path, entries)
    assert [station.name for station in campaign.site.weather_station] == ["WX2"]
    assert done.notes == ("weather stations without readings were left out of site.toml: WX1",)
