"""What Prometheus scrapes at /metrics: how well the sensor, the processing and the recorder do."""

from collections.abc import Iterable, Iterator

from fastapi import APIRouter
from prometheus_client import (
    CollectorRegistry,
    Histogram,
    PlatformCollector,
    ProcessCollector,
    generate_latest,
)
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST
from prometheus_client.registry import Collector
from starlette.responses import Response

from ..jobs.recorder import AsyncRecorder
from ..pipeline.frame import Frame
from ..pipeline.runtime import Runtime
from ..pipeline.slam_run import Localization
from ..sources.source import DeviceStatus
from .stream.hub import Hub

LATENCY = (0.001, 0.002, 0.003, 0.005, 0.0075, 0.01, 0.02, 0.05, 0.1, 1.0)  # s
WORK = (2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 1e-1)  # s


class Metrics(Collector):
    """Counts frames as they pass; what others count already is read from them when it is asked for."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        PlatformCollector(registry=self.registry)
        self._latency = self._histogram(
            "latency", "from the last byte of a revolution to a browser's socket", LATENCY
        )
        self._extraction = self._histogram("extraction", "segments and corners by every method shown", WORK)
        self._location = self._histogram("location", "the pose and the map", WORK)
        self._drawing = self._histogram("drawing", "the scene", WORK)
        self._located: Localization | None = None

    def observe(self, runtime: Runtime, hub: Hub, recorder: AsyncRecorder) -> None:
        """Report on these from now on."""
        self._runtime, self._hub, self._recorder = runtime, hub, recorder
        runtime.frame_listeners.append(self._processed)
        self.registry.register(self)

    def sent(self, frame: Frame) -> None:
        """Count a frame that was handed to a browser's socket."""
        self._latency.observe(frame.age())

    def text(self) -> bytes:
        """All metrics, in Prometheus' text format."""
        return generate_latest(self.registry)

    def collect(self) -> Iterator[Metric]:
        """Metrics whose values are known elsewhere; called by the registry."""
        frame, status = self._runtime.frame, self._recorder.status
        yield _counter("frames", "scans processed", frame.sequence if frame else 0)
        yield _counter("frames_dropped", "scans overtaken by a newer one", frame.dropped if frame else 0)
        yield _gauge("browsers", "clients of the stream", self._hub.clients)
        yield _gauge("recording", "1 while recording", status.state == "recording")
        yield _gauge("recording_bytes", "size of the recording", status.size)
        yield _gauge("recording_dropped", "scans and reads that the recording lacks", status.dropped)
        if frame and frame.localization:
            yield from _localization(frame.localization)
        if device := self._runtime.player.source.device():
            yield from _device(device)

    def describe(self) -> Iterable[Metric]:
        """Nothing ahead: there is no source yet when this is registered."""
        return []

    def _processed(self, frame: Frame) -> None:
        self._extraction.observe(1e-6 * frame.extract_us)
        self._drawing.observe(1e-6 * frame.draw_us)
        drawn_again = frame.localization is self._located
        if frame.locate_us is not None and not drawn_again:
            self._location.observe(1e-6 * frame.locate_us)
        self._located = frame.localization

    def _histogram(self, name: str, about: str, buckets: tuple[float, ...]) -> Histogram:
        return Histogram(
            f"lidarcore_{name}_seconds", f"Time: {about}", buckets=buckets, registry=self.registry
        )


def _localization(localization: Localization) -> Iterator[Metric]:
    found = localization.tracking
    yield _gauge("tracking", "1 while the pose is known", found.state == "tracking")
    yield _gauge("landmarks", "confirmed ones of the map", found.landmarks.confirmed.sum())
    yield _gauge("matched", "landmarks recognised in the newest scan", len(found.pairs))
    yield _gauge("nis", "normalised innovation squared of the newest scan", found.nis)


def _device(device: DeviceStatus) -> Iterator[Metric]:
    yield _gauge("sensor_streaming", "1 while measurements arrive", device.state == "streaming")
    yield _gauge("sensor_revolutions_per_second", "of the last 10", device.rate_hz)
    yield _gauge("sensor_samples_per_second", "of the last 10 revolutions", device.samples_per_s)
    yield _gauge("sensor_completeness", "share of the last 10 revolutions that arrived", device.completeness)
    yield _counter("sensor_bytes", "bytes received", device.bytes)
    yield _counter("sensor_revolutions", "revolutions received", device.revolutions)
    yield _counter("sensor_reconnects", "connections after the first", device.reconnects)
    yield _counter("sensor_overruns", "revolutions nobody took in time", device.overruns)
    dropped = CounterMetricFamily(
        "lidarcore_sensor_dropped", "Dropped on the way, by reason", labels=["reason"]
    )
    for reason, count in device.dropped.items():
        dropped.add_metric([reason], count)
    yield dropped


def _counter(name: str, about: str, value: float) -> Metric:
    return CounterMetricFamily(f"lidarcore_{name}", about, value=value)


def _gauge(name: str, about: str, value: float) -> Metric:
    return GaugeMetricFamily(f"lidarcore_{name}", about, value=float(value))


def metrics_router(metrics: Metrics) -> APIRouter:
    """The route /metrics."""
    routes = APIRouter(tags=["meta"])

    @routes.get("/metrics", response_class=Response, responses={200: {"content": {CONTENT_TYPE_LATEST: {}}}})
    def scrape() -> Response:
        """Counters, gauges and histograms for Prometheus."""
        return Response(metrics.text(), media_type=CONTENT_TYPE_LATEST)

    return routes
