"""A run of a journal, or a part of it, as a campaign directory that `catseye reduce` reads.

What a campaign cannot hold is left out and told: shots without samples, taken in another way than site.toml says, not
later than the ranger's last, without weather; readings with a silent sensor. What the live reduction did not believe
goes along in doubts.csv, how far the telescope's bodies shook in jitter.csv, and in postures.csv where it was, if it
moved. The directory is read before it appears.
"""

import csv
import io
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from catseye.constants import DEGREE
from catseye.coordinator.journal.check import ChainReport
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution, StoredAnswer
from catseye.coordinator.journal.reader import JournalReader
from catseye.errors import InputError
from catseye.gateways.journal.chain import chain_object, export_verdict
from catseye.gateways.journal.export import seal, stamp
from catseye.gateways.journal.motion import JournalMotion, MotionRows
from catseye.gateways.writers.output import whole_directory
from catseye.gateways.writers.written import origin
from catseye.records.night.campaign import LONGEST_CAMPAIGN, WEATHER_MARGIN, read_campaign
from catseye.records.night.doubt import DOUBTS, DoubtRow, believed_samples
from catseye.records.night.jitter import JITTER, JitterRow
from catseye.records.night.live import TICKS_PER_DAY, LiveWeather
from catseye.records.night.postures import POSTURES, PostureRow
from catseye.records.night.shot import ShotRow
from catseye.records.night.weather import WeatherSample
from catseye.records.site.folder import REFERENCE, SiteFolder, site_files
from catseye.reduction.epoch.reason import ShotStatus, status_of
from catseye.reduction.live.weather import StationWatch
from catseye.verdict import Verdict

MARGIN = round(WEATHER_MARGIN * TICKS_PER_DAY)  # ticks
MOST_TOLD = 3  # examples of each reason
LIES = (ShotStatus.REFLECTED, ShotStatus.BAD_REFERENCE)  # what a night's own samples may not show again


@dataclass
class LeftOut:
    """Why and how often something was left out, and the first few of each."""

    counts: Counter[str] = field(default_factory=Counter)
    examples: dict[str, list[str]] = field(default_factory=dict)

    def add(self, reason: str, which: str) -> None:
        self.counts[reason] += 1
        if self.counts[reason] <= MOST_TOLD:
            self.examples.setdefault(reason, []).append(which)

    def notes(self) -> list[str]:
        """What was left out, a line for each reason."""
        return [
            f"left out {count}: {reason} ({', '.join(self.examples[reason])}{', ...' if count > MOST_TOLD else ''})"
            for reason, count in sorted(self.counts.items())
        ]


@dataclass(frozen=True)
class CampaignExport:
    """What was written.

    shots, readings   how many
    left_out          how many of each reason
    notes             lines for people: what was left out, what was changed
    verdict           a reduction of the campaign is no better
    """

    shots: int
    readings: int
    left_out: dict[str, int]
    notes: tuple[str, ...]
    verdict: Verdict


@dataclass(frozen=True)
class ExportedShot:
    """A shot that goes into the campaign."""

    ticks: int
    seq: int
    number: int
    ranger: str
    target: str
    cycles: int
    samples_per_cycle: int


def export_campaign(
    reader: JournalReader,
    out: Path,
    *,
    run: int,
    span: tuple[int, int] | None = None,
    chain: ChainReport | None = None,
) -> CampaignExport:
    """A run's shots, samples and weather in the layout of docs/formats/campaign.md, whole or not at all.

    run    its number
    span   ticks, the end not in it; all
    chain  what checking said: events that are not as they were written are left out, and told

    Raises InputError: no such run, no shot or weather that a campaign can hold, a directory that is another's.
    """
    stored, site = reader.run(run), reader.site(run)
    left = LeftOut()
    reader.left_out = {} if chain is None else {run: chain.bad}
    for seq in sorted(reader.left_out.get(run, ())):
        left.add("an event that is not as it was written", f"event {seq}")
    readings, why = _readings(reader, run, span, site, left)
    if not readings:
        raise InputError(f"journal {reader.place}: run {run} has no whole weather reading in the span (expected one)")
    motion = JournalMotion.of(reader, run, span)
    chosen = _chosen(reader, run, span, site, left, sorted(reading.ticks for reading in readings), motion)
    if not chosen:
        reasons = "; ".join(left.notes()) or "no shots in the span"
        raise InputError(f"journal {reader.place}: run {run} has no shot that a campaign can hold: {reasons}")
    notes, wrong = left.notes(), list[str]()
    doubts = _doubts(reader, run, chosen, readings, why, notes, wrong)
    stood = motion.during((chosen[0].ticks, chosen[-1].ticks), notes)
    wrong += [stood.wrong] * bool(stood.wrong)
    site = _as_it_stood(site, chosen, readings, stood, notes, wrong)
    verdict = export_verdict(chain, len(chosen) + len(readings), wrong)
    with whole_directory(out, Path(reader.place)) as directory:
        for path, text in site_files(site).items():
            (directory / path).parent.mkdir(exist_ok=True)
            (directory / path).write_text(text, encoding="utf-8", newline="")
        for name in ("monuments", "mirrors", "triplets"):  # which must be there, be they empty
            (directory / name).mkdir(exist_ok=True)
        (directory / "weather.csv").write_text(_weather_csv(readings), encoding="utf-8", newline="")
        (directory / "shots.csv").write_text(_shots_csv(chosen, notes), encoding="utf-8", newline="")
        for name, rows in ((DOUBTS, doubts), (JITTER, stood.jitter), (POSTURES, stood.postures)):
            if rows:
                (directory / name).write_text(_table(rows), encoding="utf-8", newline="")
        _write_frames(reader, run, chosen, directory / "frames.npy")
        read_campaign(directory)
        provenance = origin(datetime.now(UTC), stored.hashes)
        chains = [] if chain is None else [chain_object(chain)]
        told = {"run": stored.uuid, "notes": notes, "chains": chains, "verdict": verdict.to_object()}
        seal(directory, reader, {"made_by": "catseye export", **provenance, **told})
    return CampaignExport(len(chosen), len(readings), dict(left.counts), tuple(notes), verdict)


def _readings(
    reader: JournalReader, run: int, span: tuple[int, int] | None, site: SiteFolder, left: LeftOut
) -> tuple[list[LiveWeather], dict[tuple[str, int], str]]:
    """Whole readings of the site's stations, in order of time, an hour longer than the span; and why which of them,
    by station and ticks, does not count: the live reduction's watch is asked again, in the journal's order and with
    what its epochs suspected, and marks whole stretches."""
    readings: list[LiveWeather] = []
    why: dict[tuple[str, int], str] = {}
    watch = StationWatch.of(site)
    for _, entry in reader.events(run, kinds=["weather", "solutions"]):
        if isinstance(entry, EpochSolution):
            watch.judged(_suspected(entry.answer))
        elif isinstance(entry, LiveWeather):
            doubt = watch.add(entry)
            if span is None or span[0] - MARGIN <= entry.ticks < span[1] + MARGIN:
                readings.append(entry)
                by_itself = doubt and not watch.doubting(entry.station)
                why |= {(entry.station, entry.ticks): doubt} if by_itself else {}
    for stretch in watch.stretches():
        for read in readings:
            inside = stretch.first <= read.ticks and (stretch.last is None or read.ticks <= stretch.last)
            if read.station == stretch.station and inside:
                why.setdefault((read.station, read.ticks), stretch.why)
    stations = {station.name for station in site.site.weather_station}
    kept: list[LiveWeather] = []
    latest: dict[str, int] = {}
    for read in sorted(readings, key=lambda read: read.ticks):
        which = f"{read.station} at {stamp(read.ticks)}"
        if read.station not in stations:
            left.add("a reading of a station that site.toml does not name", which)
        elif read.ticks <= latest.get(read.station, -1):
            left.add("a reading not later than its station's last", which)
        elif problem := _unholdable(read):
            left.add(problem, which)
        else:
            latest[read.station] = read.ticks
            kept.append(read)
    return kept, why


def _suspected(answer: StoredAnswer) -> dict[str, tuple[float, bool]]:
    """Suspicions of a stored answer, as `StationWatch.judged` takes them; none of one that an older version wrote."""
    biases = answer.get("biases") or {}
    return {name: (float(str(b["offset_c"])), b["judgement"] == "biased") for name, b in biases.items()}


def _doubts(
    reader: JournalReader,
    run: int,
    chosen: list[ExportedShot],
    readings: list[LiveWeather],
    why: dict[tuple[str, int], str],
    notes: list[str],
    wrong: list[str],
) -> list[DoubtRow]:
    """Exported readings and shots that the live reduction did not believe; `wrong` hears what spoils the campaign."""
    made = [
        DoubtRow(what="weather", name=read.station, mjd_utc=float(stamp(read.ticks)), why=why[read.station, read.ticks])
        for read in readings
        if (read.station, read.ticks) in why
    ]
    if made:
        times = np.array([float(stamp(shot.ticks)) for shot in chosen])
        try:
            told = believed_samples([_sample(read) for read in readings], made, times)[1]
        except InputError:
            told, made = ["no weather station was believed throughout: all readings are exported as they are"], []
            wrong += told
        notes += told
    reasons: dict[int, str] = {}
    for _, solution in reader.solutions(run):
        for number, line in (solution.answer.get("rejected") or {}).items():
            if status_of(line) in LIES:
                reasons[int(number)] = line
    names = _names(chosen)
    shots = [
        DoubtRow(what="shot", name=str(name), mjd_utc=float(stamp(shot.ticks)), why=reasons[shot.number][:500])
        for name, shot in zip(names, chosen, strict=True)
        if shot.number in reasons
    ]
    if shots:
        notes.append(f"named in {DOUBTS} as not believed by the epochs: {len(shots)} of the shots")
    return made + shots


def _table(rows: Sequence[DoubtRow | JitterRow | PostureRow]) -> str:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, tuple(type(rows[0]).model_fields), lineterminator="\n")
    writer.writeheader()
    for each in rows:
        writer.writerow(each.model_dump() | {"mjd_utc": f"{each.mjd_utc:.8f}"})
    return text.getvalue()


def _sample(read: LiveWeather) -> WeatherSample:
    return WeatherSample(
        mjd_utc=float(stamp(read.ticks)),
        station=read.station,
        temperature_c=read.temperature_c,
        pressure_mb=read.pressure_hpa,
        humidity_pct=read.humidity_percent,
    )


def _unholdable(read: LiveWeather) -> str:
    values = (read.temperature_c, read.pressure_hpa, read.humidity_percent)
    if not np.isfinite(values).all():
        return "a reading with a silent sensor"
    try:
        _sample(read)
    except ValidationError:
        return "a reading out of a thermometer's, barometer's or hygrometer's range"
    return ""


def _chosen(
    reader: JournalReader,
    run: int,
    span: tuple[int, int] | None,
    site: SiteFolder,
    left: LeftOut,
    weather: list[int],
    motion: JournalMotion,
) -> list[ExportedShot]:
    """The shots that a campaign holds, in order of time."""
    refusal = _refusals(site, weather, motion)
    chosen: list[ExportedShot] = []
    for seq, entry in reader.shots(run):
        shot = entry.shot
        if span is not None and not span[0] <= shot.ticks < span[1]:
            continue
        if reason := refusal(entry):
            left.add(reason, f"shot {shot.number} of {shot.ranger}")
            continue
        taken = (shot.number, shot.ranger, shot.target, shot.cycles, shot.samples_per_cycle)
        chosen.append(ExportedShot(shot.ticks, seq, *taken))
    chosen.sort(key=lambda shot: (shot.ticks, shot.seq))
    kept: list[ExportedShot] = []
    latest: dict[str, int] = {}
    for shot_ in chosen:
        which = f"shot {shot_.number} of {shot_.ranger}"
        if shot_.ticks <= latest.get(shot_.ranger, -1):
            left.add("a shot not later than its ranger's last", which)
        elif shot_.ticks - chosen[0].ticks > LONGEST_CAMPAIGN * TICKS_PER_DAY:
            left.add("a shot more than a day after the first", which)
        else:
            latest[shot_.ranger] = shot_.ticks
            kept.append(shot_)
    return kept


def _refusals(site: SiteFolder, weather: list[int], motion: JournalMotion) -> Callable[[AnsweredShot], str]:
    """What says why a campaign of a site cannot hold a shot; "" where it can."""
    rangers, targets = set(site.rangers), set(site.target_names) | {REFERENCE}
    ranging, adc = site.site.ranging, site.site.adc
    volts = adc.full_scale_volt / 2**15

    def refusal(entry: AnsweredShot) -> str:
        shot = entry.shot
        if shot.samples is None:
            return "a shot without samples"
        if len(shot.samples) != shot.cycles * shot.samples_per_cycle:
            return "a shot with samples missing"
        if shot.ranger not in rangers or shot.target not in targets or shot.target == shot.ranger:
            return "a shot of or at what the site does not have"
        if shot.if_hz != ranging.if_hz or abs(shot.volts_per_code / volts - 1.0) > 1e-9:
            return "a shot with another if_hz or volts a code than site.toml's"
        if not weather[0] - MARGIN <= shot.ticks <= weather[-1] + MARGIN:
            return "a shot without weather within 1 h"
        if motion.lacks(shot.ticks):
            return "a shot without a posture within 2 s"
        try:
            _row(1, shot.ticks, shot.ranger, shot.target, shot.cycles, shot.samples_per_cycle, 0)
        except ValidationError:
            return "a shot that shots.csv cannot hold"
        return ""

    return refusal


def _as_it_stood(
    site: SiteFolder,
    chosen: list[ExportedShot],
    readings: list[LiveWeather],
    told: MotionRows,
    notes: list[str],
    wrong: list[str],
) -> SiteFolder:
    """The site with the campaign's start and posture, and the stations that spoke; `wrong` as for `_doubts`."""
    named: dict[str, object] = {"start_mjd_utc": chosen[0].ticks / TICKS_PER_DAY}
    if told.posture is not None:
        azimuth, elevation = told.posture
        named |= {"azimuth_deg": azimuth / DEGREE % 360.0, "elevation_deg": elevation / DEGREE}
    else:
        wrong.append("no posture was journalled in the span: azimuth and elevation are site.toml's")
        notes.append(wrong[-1])
    spoke = {read.station for read in readings}
    stations = tuple(station for station in site.site.weather_station if station.name in spoke)
    if silent := sorted({station.name for station in site.site.weather_station} - spoke):
        notes.append(f"weather stations that said nothing were left out of site.toml: {', '.join(silent)}")
    posture = site.site.campaign.model_copy(update=named)
    return replace(site, site=site.site.model_copy(update={"campaign": posture, "weather_station": stations}))


def _row(number: int, ticks: int, ranger: str, target: str, cycles: int, samples_per_cycle: int, frame: int) -> ShotRow:
    return ShotRow(
        shot=number,
        mjd_utc=ticks / TICKS_PER_DAY,
        ranger=ranger,
        target=target,
        cycles=cycles,
        samples_per_cycle=samples_per_cycle,
        frame=frame,
    )


def _shots_csv(chosen: list[ExportedShot], notes: list[str]) -> str:
    """Shots by their numbers; by their seq where numbers are not each once."""
    numbers = _names(chosen)
    if numbers != [shot.number for shot in chosen]:
        notes.append("shot numbers are not each once: shots.csv has the journal's seq instead")
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(ShotRow.model_fields)
    for frame, (number, shot) in enumerate(zip(numbers, chosen, strict=True)):
        row = (number, stamp(shot.ticks), shot.ranger, shot.target, shot.cycles, shot.samples_per_cycle, frame)
        writer.writerow(row)
    return text.getvalue()


def _names(chosen: list[ExportedShot]) -> list[int]:
    """What shots.csv calls them: their numbers, or their seq where numbers are not each once."""
    numbers = [shot.number for shot in chosen]
    distinct = len(set(numbers)) == len(numbers) and min(numbers) >= 0
    return numbers if distinct else [shot.seq for shot in chosen]


def _weather_csv(readings: list[LiveWeather]) -> str:
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(WeatherSample.model_fields)
    for read in readings:
        values = (read.temperature_c, read.pressure_hpa, read.humidity_percent)
        writer.writerow((stamp(read.ticks), read.station, *(repr(float(value)) for value in values)))
    return text.getvalue()


def _write_frames(reader: JournalReader, run: int, chosen: list[ExportedShot], path: Path) -> None:
    """A row a shot, as long as the longest, zeros behind the shorter ones; one buffer in memory at a time.

    Written, not mapped: where the disk is full, a mapped file ends the process.
    """
    width = max(shot.cycles * shot.samples_per_cycle for shot in chosen)
    rows = {shot.seq: row for row, shot in enumerate(chosen)}
    with path.open("wb") as file:
        header = {"descr": "<i2", "fortran_order": False, "shape": (len(chosen), width)}
        np.lib.format.write_array_header_1_0(file, header)
        first = file.tell()
        file.truncate(first + 2 * width * len(chosen))
        for seq, entry in reader.shots(run):
            if seq in rows and entry.shot.samples is not None:
                file.seek(first + 2 * width * rows[seq])
                file.write(np.asarray(entry.shot.samples, "<i2").tobytes())
