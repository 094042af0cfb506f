"""Metrics of the service and of its site, in Prometheus' text format."""

from collections.abc import Iterator
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Histogram, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.registry import Collector
from starlette.responses import Response

from catseye.version import __version__
from catseye.web.refusals import RefusalLog
from catseye.web.subject import PageSubject

DAY = 86_400.0  # s
BUCKETS = (0.001, 0.005, 0.02, 0.1, 0.5, 2.0, 10.0)  # s


class PageMetrics:
    """Registry of one service."""

    def __init__(self, subject: PageSubject, refusals: RefusalLog):
        self._registry = CollectorRegistry()
        self._requests = Counter(
            "catseye_page_requests", "Answers by route and status", ("route", "status"), registry=self._registry
        )
        self._seconds = Histogram(
            "catseye_page_request_seconds", "Time until an answer", buckets=BUCKETS, registry=self._registry
        )
        ProcessCollector(registry=self._registry)
        self._registry.register(_FeedCollector(subject, refusals))
        self._registry.register(_SiteCollector(subject))

    def measured(self, route: str, status: int, seconds: float) -> None:
        """Count an answer and its time."""
        self._requests.labels(route, str(status)).inc()
        self._seconds.observe(seconds)

    def answer(self) -> Response:
        """Answer with the text of all metrics."""
        return Response(generate_latest(self._registry), 200, None, CONTENT_TYPE_LATEST)


class _FeedCollector(Collector):
    """Clients, events, refusals."""

    def __init__(self, subject: PageSubject, refusals: RefusalLog):
        self._subject, self._refusals = subject, refusals

    def collect(self) -> Iterator[Metric]:
        feed = self._subject.feed
        labels = {"version": __version__, "kind": self._subject.kind}
        yield InfoMetricFamily("catseye", "Version and subject of the service", labels)
        yield GaugeMetricFamily("catseye_page_clients", "Clients of the live events", len(feed.clients))
        for name, words, counts, label in (
            ("catseye_page_events", "Events of the site by kind", feed.events, "kind"),
            ("catseye_page_dropped", "Events that slow clients lost, by kind", feed.dropped, "kind"),
            ("catseye_page_refused", "Refused requests and connections by reason", self._refusals.counts, "reason"),
        ):
            family = CounterMetricFamily(name, words, labels=[label])
            for key, count in sorted(counts.items()):
                family.add_metric([key], count)
            yield family


class _SiteCollector(Collector):
    """Values of the site's state."""

    def __init__(self, subject: PageSubject):
        self._subject = subject

    def collect(self) -> Iterator[Metric]:
        watch = self._subject.watch
        if watch is None or self._subject.kind != "site":
            return
        state, now = watch.state(), self._subject.now()
        yield GaugeMetricFamily("catseye_connected", "1 while the coordinator answers", float(state["connected"]))
        yield from _gauge(
            "catseye_state_age_seconds", "Age of the coordinator's last word", age(now, state["received"])
        )
        yield from self._counts(state)
        epoch = state["epoch"] or {}
        for key, name, words in (
            ("number", "catseye_epoch_number", "Number of the last epoch"),
            ("points", "catseye_epoch_points", "Points of the last epoch"),
            ("rejected", "catseye_epoch_rejected_shots", "Shots that the last epoch does not use"),
            ("variance_factor", "catseye_epoch_variance_factor", "Variance factor of the last epoch"),
        ):
            yield from _gauge(name, words, epoch.get(key))
        yield from _gauge("catseye_epoch_age_seconds", "Age of the last epoch", age(now, epoch.get("mjd")))
        yield from self._weather(state)
        yield from self._rangers(state, now)

    def _counts(self, state: dict[str, Any]) -> Iterator[Metric]:
        counts = state["shots"] or {}
        for key, words in (("numbered", "Shots with a number"), ("acknowledged", "Shots that the journal holds")):
            if counts.get(key) is not None:
                yield CounterMetricFamily(f"catseye_shots_{key}", words, counts[key])
        alarms = GaugeMetricFamily(
            "catseye_alarms", "Alarms by severity and whether shelved", labels=["severity", "shelved"]
        )
        found: dict[tuple[str, str], int] = {}
        for problem in state["problems"]:
            key_ = (problem["severity"], "no" if problem["shelved_by"] is None else "yes")
            found[key_] = found.get(key_, 0) + 1
        for labels, count in sorted(found.items()):
            alarms.add_metric(list(labels), count)
        yield alarms

    def _weather(self, state: dict[str, Any]) -> Iterator[Metric]:
        for key, name, words in (
            ("temperature_c", "catseye_weather_temperature_celsius", "Temperature of a station"),
            ("pressure_hpa", "catseye_weather_pressure_hectopascals", "Pressure of a station"),
            ("humidity_percent", "catseye_weather_humidity_percent", "Relative humidity of a station"),
        ):
            family = GaugeMetricFamily(name, words, labels=["station"])
            for row in state["weather"]:
                if row[key] is not None:
                    family.add_metric([row["station"]], row[key])
            yield family

    def _rangers(self, state: dict[str, Any], now: float) -> Iterator[Metric]:
        shots = CounterMetricFamily("catseye_ranger_shots", "Shots of a ranger", labels=["ranger"])
        failures = CounterMetricFamily("catseye_ranger_failures", "Failed shots of a ranger", labels=["ranger"])
        ages = GaugeMetricFamily("catseye_ranger_shot_age_seconds", "Age of a ranger's last shot", labels=["ranger"])
        for row in state["rangers"]:
            if row["shots"] is not None:
                shots.add_metric([row["name"]], row["shots"])
            if row["failures"] is not None:
                failures.add_metric([row["name"]], row["failures"])
            if row["mjd"] is not None:
                ages.add_metric([row["name"]], (now - row["mjd"]) * DAY)
        yield from (shots, failures, ages)


def _gauge(name: str, words: str, value: float | None) -> Iterator[Metric]:
    if value is not None:
        yield GaugeMetricFamily(name, words, value)


def age(now: float, mjd: float | None) -> float | None:
    """Age in s of an instant; None for none.

    >>> age(60_000.5, 60_000.25)
    21600.0
    """
    return None if mjd is None else (now - mjd) * DAY
