"""Events about weather stations: rejected readings, suspected thermometers."""

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.parts import Clock, Tell
from catseye.records.night.live import LiveWeather
from catseye.reduction.live.live import EpochAnswer

DOUBTED, BIASED, APART = "weather-doubted", "weather-biased", "weather-apart"
RETURNED = "weather-returned"
JUDGEMENTS = {"biased": BIASED, "apart": APART}


class StationEvents:
    """Events of each station at start and end of a suspicion."""

    def __init__(self, clock: Clock, tell: Tell):
        self._clock, self._tell = clock, tell
        self._stations: dict[str, EventLog] = {}
        self._reduction = EventLog("reduction", clock, tell)

    def read(self, reading: LiveWeather, doubt: str) -> None:
        """Log the rejection of a reading, or its end.

        doubt   reason, "" if accepted
        """
        over = f"{reading.station}'s readings are accepted again"
        self._log(reading.station).standing(DOUBTED, doubt or None, over=over)

    def solved(self, answer: EpochAnswer) -> None:
        """Log an epoch's suspicions and doubts."""
        for stretch in answer.returned:
            log = self._log(stretch.station)
            log.tell(RETURNED, stretch.why, "warning", always=True, offset_c=stretch.offset_c)
        for name in sorted({*self._stations, *answer.biases}):
            log, suspect = self._log(name), answer.biases.get(name)
            for judgement, kind in JUDGEMENTS.items():
                if suspect is not None and suspect.judgement == judgement:
                    log.standing(kind, suspect.text(name), offset_c=suspect.offset_c)
                elif DOUBTED not in log.standings:  # a station that is not in the epoch is not suspected by it
                    log.standing(kind, None, over=f"{name}'s thermometer is no longer suspected")
        doubt = answer.doubts[0] if answer.doubts else None
        self._reduction.standing("epoch-doubtful", doubt, over="epochs are good again")

    def _log(self, station: str) -> EventLog:
        return self._stations.setdefault(station, EventLog(station, self._clock, self._tell))
