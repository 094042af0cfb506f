"""Selection of a journal's run, or part of it, as a campaign for `catseye reduce`.

Entries that a campaign cannot hold are left out and reported: shots without samples, taken with other settings than
site.toml's, not later than the ranger's last, without weather; readings with a missing sensor. Readings and shots that
the live reduction rejected are listed as doubts.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic import ValidationError

from catseye.constants import DEGREE
from catseye.coordinator.journal.check import ChainReport
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution, StoredAnswer
from catseye.coordinator.journal.motion import JournalMotion, MotionRows
from catseye.coordinator.journal.reader import JournalReader, StoredRun
from catseye.coordinator.journal.verdict import export_verdict
from catseye.errors import InputError
from catseye.ranger.line import stamp_text
from catseye.records.night.campaign import LONGEST_CAMPAIGN, WEATHER_MARGIN
from catseye.records.night.doubt import DOUBTS, DoubtRow, trusted_samples
from catseye.records.night.live import TICKS_PER_DAY, LiveWeather
from catseye.records.night.shot import ShotRow
from catseye.records.night.weather import WeatherSample
from catseye.records.site.folder import REFERENCE, SiteFolder
from catseye.reduction.epoch.reason import ShotStatus, status_of
from catseye.reduction.live.weather import StationWatch
from catseye.verdict import Verdict

MARGIN = round(WEATHER_MARGIN * TICKS_PER_DAY)  # ticks
MOST_EXAMPLES = 3  # examples of each reason
HIDDEN_FAULTS = (ShotStatus.REFLECTED, ShotStatus.BAD_REFERENCE)  # may not show again in the night's own samples


@dataclass
class LeftOut:
    """Reasons for omissions, with counts and the first few examples."""

    counts: Counter[str] = field(default_factory=Counter)
    examples: dict[str, list[str]] = field(default_factory=dict)

    def add(self, reason: str, which: str) -> None:
        self.counts[reason] += 1
        if self.counts[reason] <= MOST_EXAMPLES:
            self.examples.setdefault(reason, []).append(which)

    def notes(self) -> list[str]:
        """One line per reason for an omission."""
        return [
            f"left out {count}: {reason} ({', '.join(self.examples[reason])}{', ...' if count > MOST_EXAMPLES else ''})"
            for reason, count in sorted(self.counts.items())
        ]


@dataclass(frozen=True)
class ExportedShot:
    """Shot that goes into the campaign."""

    ticks: int
    seq: int
    number: int
    ranger: str
    target: str
    cycles: int
    samples_per_cycle: int


@dataclass(frozen=True, eq=False)
class JournalCampaign:
    """Part of a journal's run that a campaign can hold.

    reader, run   the journal, and the run
    site          its records, with the campaign's start and posture and the stations with readings
    shots         in time order
    numbers       of the shots in shots.csv: their own, or seq where these are not unique
    readings      of the weather, in time order
    doubts        readings and shots that the live reduction rejected
    motion        posture, postures and jitter
    left_out      number omitted, by reason
    notes         lines on omissions and changes
    verdict       upper limit of the verdict of a reduction of the campaign
    chain         result of the check; None if not checked
    """

    reader: JournalReader
    run: StoredRun
    site: SiteFolder
    shots: tuple[ExportedShot, ...]
    numbers: tuple[int, ...]
    readings: tuple[LiveWeather, ...]
    doubts: tuple[DoubtRow, ...]
    motion: MotionRows
    left_out: dict[str, int]
    notes: tuple[str, ...]
    verdict: Verdict
    chain: ChainReport | None


def journal_campaign(
    reader: JournalReader, run: int, *, span: tuple[int, int] | None = None, chain: ChainReport | None = None
) -> JournalCampaign:
    """Select a run's shots and weather for a campaign.

    run    number of the run
    span   ticks, end exclusive; None for all
    chain  result of the check; altered events are left out and reported

    Raises InputError: unknown run, no shot or weather that a campaign can hold.
    """
    stored, site = reader.run(run), reader.site(run)
    omissions = LeftOut()
    reader.left_out = {} if chain is None else {run: chain.bad}
    for seq in sorted(reader.left_out.get(run, ())):
        omissions.add("an event that is not as it was written", f"event {seq}")
    readings, why = _readings(reader, run, span, site, omissions)
    if not readings:
        raise InputError(f"journal {reader.place}: run {run} has no complete weather reading in the span")
    motion = JournalMotion.of(reader, run, span)
    chosen = _chosen(reader, run, span, site, omissions, sorted(reading.ticks for reading in readings), motion)
    if not chosen:
        reasons = "; ".join(omissions.notes()) or "no shots in the span"
        raise InputError(f"journal {reader.place}: run {run} has no shot that a campaign can hold: {reasons}")
    notes, wrong = omissions.notes(), list[str]()
    numbers = _numbers(chosen)
    doubts = _doubts(reader, run, chosen, numbers, readings, why, notes, wrong)
    motion_rows = motion.during((chosen[0].ticks, chosen[-1].ticks), notes)
    wrong += [motion_rows.wrong] * bool(motion_rows.wrong)
    site = _observed_site(site, chosen, readings, motion_rows, notes, wrong)
    verdict = export_verdict(chain, len(chosen) + len(readings), wrong)
    if numbers != [shot.number for shot in chosen]:
        notes.append("shot numbers are not unique: shots.csv has the journal's seq instead")
    return JournalCampaign(
        reader=reader,
        run=stored,
        site=site,
        shots=tuple(chosen),
        numbers=tuple(numbers),
        readings=tuple(readings),
        doubts=tuple(doubts),
        motion=motion_rows,
        left_out=dict(omissions.counts),
        notes=tuple(notes),
        verdict=verdict,
        chain=chain,
    )


def _readings(
    reader: JournalReader, run: int, span: tuple[int, int] | None, site: SiteFolder, omissions: LeftOut
) -> tuple[list[LiveWeather], dict[tuple[str, int], str]]:
    """Complete readings of the site's stations, and reasons for rejected ones by station and ticks.

    In time order, an hour longer than the span. The live reduction's watch is run again, in the journal's order and
    with the suspicions of its epochs, and marks complete stretches.
    """
    readings: list[LiveWeather] = []
    why: dict[tuple[str, int], str] = {}
    watch = StationWatch.of(site)
    for _, entry in reader.events(run, kinds=["weather", "solutions"]):
        if isinstance(entry, EpochSolution):
            watch.judged(_suspicions(entry.answer))
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
    accepted: list[LiveWeather] = []
    latest: dict[str, int] = {}
    for read in sorted(readings, key=lambda read: read.ticks):
        which = f"{read.station} at {stamp_text(read.ticks)}"
        if read.station not in stations:
            omissions.add("a reading of a station that site.toml does not name", which)
        elif read.ticks <= latest.get(read.station, -1):
            omissions.add("a reading not later than its station's last", which)
        elif problem := _unholdable(read):
            omissions.add(problem, which)
        else:
            latest[read.station] = read.ticks
            accepted.append(read)
    return accepted, why


def _suspicions(answer: StoredAnswer) -> dict[str, tuple[float, bool]]:
    """Suspicions of a stored answer for `StationWatch.judged`; empty for older versions."""
    biases = answer.get("biases") or {}
    return {name: (float(str(b["offset_c"])), b["judgement"] == "biased") for name, b in biases.items()}


def _doubts(
    reader: JournalReader,
    run: int,
    chosen: list[ExportedShot],
    numbers: list[int],
    readings: list[LiveWeather],
    why: dict[tuple[str, int], str],
    notes: list[str],
    wrong: list[str],
) -> list[DoubtRow]:
    """Rows of readings and shots rejected by the live reduction.

    Problems that make the campaign doubtful are appended to `wrong`.
    """
    rows = [
        DoubtRow(
            what="weather", name=read.station, mjd_utc=float(stamp_text(read.ticks)), why=why[read.station, read.ticks]
        )
        for read in readings
        if (read.station, read.ticks) in why
    ]
    if rows:
        times = np.array([float(stamp_text(shot.ticks)) for shot in chosen])
        try:
            messages = trusted_samples([_sample(read) for read in readings], rows, times)[1]
        except InputError:
            messages, rows = ["no weather station was trusted throughout: all readings are exported unmarked"], []
            wrong += messages
        notes += messages
    reasons: dict[int, str] = {}
    for _, solution in reader.solutions(run):
        for number, line in (solution.answer.get("rejected") or {}).items():
            if status_of(line) in HIDDEN_FAULTS:
                reasons[int(number)] = line
    shots = [
        DoubtRow(what="shot", name=str(name), mjd_utc=float(stamp_text(shot.ticks)), why=reasons[shot.number][:500])
        for name, shot in zip(numbers, chosen, strict=True)
        if shot.number in reasons
    ]
    if shots:
        notes.append(f"named in {DOUBTS} as rejected by the epochs: {len(shots)} of the shots")
    return rows + shots


def _sample(read: LiveWeather) -> WeatherSample:
    return WeatherSample(
        mjd_utc=float(stamp_text(read.ticks)),
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
    omissions: LeftOut,
    weather: list[int],
    motion: JournalMotion,
) -> list[ExportedShot]:
    """Shots that a campaign can hold, in time order."""
    refusal = _refusals(site, weather, motion)
    chosen: list[ExportedShot] = []
    for seq, entry in reader.shots(run):
        shot = entry.shot
        if span is not None and not span[0] <= shot.ticks < span[1]:
            continue
        if reason := refusal(entry):
            omissions.add(reason, f"shot {shot.number} of {shot.ranger}")
            continue
        chosen.append(
            ExportedShot(
                ticks=shot.ticks,
                seq=seq,
                number=shot.number,
                ranger=shot.ranger,
                target=shot.target,
                cycles=shot.cycles,
                samples_per_cycle=shot.samples_per_cycle,
            )
        )
    chosen.sort(key=lambda shot: (shot.ticks, shot.seq))
    retained: list[ExportedShot] = []
    latest: dict[str, int] = {}
    for shot_ in chosen:
        which = f"shot {shot_.number} of {shot_.ranger}"
        if shot_.ticks <= latest.get(shot_.ranger, -1):
            omissions.add("a shot not later than its ranger's last", which)
        elif shot_.ticks - chosen[0].ticks > LONGEST_CAMPAIGN * TICKS_PER_DAY:
            omissions.add("a shot more than a day after the first", which)
        else:
            latest[shot_.ranger] = shot_.ticks
            retained.append(shot_)
    return retained


def _refusals(site: SiteFolder, weather: list[int], motion: JournalMotion) -> Callable[[AnsweredShot], str]:
    """Function that returns why a campaign of the site cannot hold a shot; "" if it can."""
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


def _observed_site(
    site: SiteFolder,
    chosen: list[ExportedShot],
    readings: list[LiveWeather],
    motion_rows: MotionRows,
    notes: list[str],
    wrong: list[str],
) -> SiteFolder:
    """Site with the campaign's start and posture and the stations with readings; `wrong` as for `_doubts`."""
    named: dict[str, object] = {"start_mjd_utc": chosen[0].ticks / TICKS_PER_DAY}
    if motion_rows.posture is not None:
        azimuth, elevation = motion_rows.posture
        named |= {"azimuth_deg": azimuth / DEGREE % 360.0, "elevation_deg": elevation / DEGREE}
    else:
        wrong.append("no posture in the journal for the span: azimuth and elevation are site.toml's")
        notes.append(wrong[-1])
    spoke = {read.station for read in readings}
    stations = tuple(station for station in site.site.weather_station if station.name in spoke)
    if silent := sorted({station.name for station in site.site.weather_station} - spoke):
        notes.append(f"weather stations without readings were left out of site.toml: {', '.join(silent)}")
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


def _numbers(chosen: list[ExportedShot]) -> list[int]:
    """Numbers in shots.csv: those of the shots, or seq where these are not unique."""
    numbers = [shot.number for shot in chosen]
    distinct = len(set(numbers)) == len(numbers) and min(numbers) >= 0
    return numbers if distinct else [shot.seq for shot in chosen]
