"""What is counted and measured in one lab, for Prometheus to read. Only numbers: nobody's id, name, address or words.

Labels have few values that are known beforehand (states, roles, codes, templates of routes), so that neither a visitor
nor the number of participants makes the metrics grow. Each lab has a registry of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, Counter, Histogram
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import generate_latest
from prometheus_client.registry import Collector

from app.processes import own_figures

CONTENT_TYPE = CONTENT_TYPE_LATEST
METHODS = frozenset({"GET", "HEAD", "POST", "DELETE", "OPTIONS", "PUT", "PATCH"})
LATE_S = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0)
"""Bounds of the lateness of a tick; from 50 ms on it is an overrun."""
COMMIT_S = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 60.0)
REQUEST_S = (0.005, 0.025, 0.1, 0.5, 1.0, 2.5, 10.0)


@dataclass(frozen=True)
class Gauge:
    """What something is at the moment it is asked for. `values` is by the value of the label, {"": x} without one.
    `is_counter`: it only grows."""

    name: str
    text: str
    values: Mapping[str, float]
    label: str = ""
    is_counter: bool = False


@dataclass
class Metrics:
    """One lab's. `gauges` is asked at each reading."""

    gauges: Callable[[], Iterable[Gauge]] = tuple
    _registry: CollectorRegistry = field(default_factory=CollectorRegistry, init=False)

    def __post_init__(self) -> None:
        registry = self._registry
        self._ticks = Counter("salab_ticks", "Ticks on disk.", registry=registry)
        self._missed = Counter("salab_ticks_missed", "Ticks that were not run because they were too late.",
                               registry=registry)  # fmt: skip
        self._late = Histogram("salab_tick_late_seconds", "How late ticks of real-time sessions began.",
                               buckets=LATE_S, registry=registry)  # fmt: skip
        self._commits = Histogram("salab_commit_seconds", "From what happened in a session to its being on disk.",
                                  buckets=COMMIT_S, registry=registry)  # fmt: skip
        self._workers = Counter("salab_worker_starts", "Sessions' processes that were started.", registry=registry)
        self._lost = Counter("salab_worker_restarts", "Sessions' processes that ended by themselves, or were ended "
                             "because they hung, and were to be replaced.", registry=registry)  # fmt: skip
        self._messages = Counter("salab_messages_refused", "Messages of pages that were refused.", ["code"],
                                 registry=registry)  # fmt: skip
        self._requests = Counter("salab_http_requests", "Answers, by the template of the route.",
                                 ["method", "route", "status"], registry=registry)  # fmt: skip
        self._request_s = Histogram("salab_http_request_seconds", "How long answers took, without sockets.",
                                    buckets=REQUEST_S, registry=registry)  # fmt: skip
        registry.register(_OwnProcess())
        registry.register(_Gauges(lambda: self.gauges()))

    def ticked(self, late_ms: float | None, missed: int) -> None:
        """A tick is on disk; `late_ms` is None in lockstep."""
        self._ticks.inc()
        self._missed.inc(missed)
        if late_ms is not None:
            self._late.observe(max(0.0, late_ms) / 1000.0)

    def committed(self, took_s: float) -> None:
        """Something of a session is on disk."""
        self._commits.observe(took_s)

    def worker_started(self) -> None:
        """A session's process was started."""
        self._workers.inc()

    def worker_lost(self) -> None:
        """A session's process ended, and was not told to."""
        self._lost.inc()

    def refused(self, code: str) -> None:
        """A message of a page was refused; `code` is one of the wire's."""
        self._messages.labels(code).inc()

    def answered(self, method: str, route: str, status: int, took_s: float) -> None:
        """A request was answered; `route` is a template, never an address that somebody asked for."""
        self._requests.labels(method if method in METHODS else "other", route, str(status)).inc()
        self._request_s.observe(took_s)

    def text(self) -> bytes:
        """Everything, in Prometheus' text format (`CONTENT_TYPE`)."""
        return generate_latest(_Plain(self._registry))  # it asks for no more than `collect`


class _Gauges(Collector):
    def __init__(self, gauges: Callable[[], Iterable[Gauge]]) -> None:
        self._gauges = gauges

    def collect(self) -> Iterator[Metric]:
        for gauge in self._gauges():
            kind = CounterMetricFamily if gauge.is_counter else GaugeMetricFamily
            family = kind(gauge.name, gauge.text, labels=[gauge.label] if gauge.label else None)
            for label, value in gauge.values.items():
                family.add_metric([label] if gauge.label else [], value)
            yield family

    def describe(self) -> Iterable[Metric]:
        """Nothing before it is asked: the lab need not be prepared yet."""
        return ()


class _OwnProcess(Collector):
    """The lab's own process, under the names that Prometheus' own collector has for it, which knows Linux alone."""

    def collect(self) -> Iterator[Metric]:
        own = own_figures()
        yield GaugeMetricFamily("process_resident_memory_bytes", "Resident memory size in bytes.", own.resident_bytes)
        yield GaugeMetricFamily("process_virtual_memory_bytes", "Virtual memory size in bytes.", own.virtual_bytes)
        yield GaugeMetricFamily("process_open_fds", "Number of open file descriptors.", own.open_files)
        yield GaugeMetricFamily("process_start_time_seconds", "When the process began, in seconds since 1970.",
                                own.began_unix_s)  # fmt: skip
        yield CounterMetricFamily("process_cpu_seconds", "User and system CPU time spent in seconds.", own.cpu_s)

    def describe(self) -> Iterable[Metric]:
        return ()


class _Plain:
    """A registry without the time at which each counter began, which the library adds to every one."""

    def __init__(self, registry: CollectorRegistry) -> None:
        self._registry = registry

    def collect(self) -> Iterator[Metric]:
        for metric in self._registry.collect():
            metric.samples = [sample for sample in metric.samples if not sample.name.endswith("_created")]
            yield metric
