"""What a server is made of, built in the order of the flow: source, pipeline, scene, jobs."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from anyio import CapacityLimiter

from lidarcore import Scan, extract
from lidarcore.body_mask import masked
from lidarcore.errors import LandmarkMapError

from ..jobs.calibration import LiveCalibration
from ..jobs.maps.maker import MapMaker
from ..jobs.maps.store import LandmarkStore
from ..jobs.profiles import Profiles
from ..jobs.recorder import AsyncRecorder
from ..jobs.repeatability import LiveRepeatability
from ..jobs.sensor_memory import SensorMemory
from ..jobs.studies.runner import Studies
from ..pipeline.navigation import Navigation
from ..pipeline.runtime import Runtime
from ..pipeline.sensor_setups import SensorSetups
from ..pipeline.settings import Settings
from ..scene.scene import Scene
from ..sources.library import MAX_BYTES, Library
from ..sources.live import DeviceOptions, Taps, connected_or_emulated
from ..sources.recorded import RecordingSource
from ..sources.source import Source
from .metrics import Metrics
from .stream.hub import Hub
from .viser_mount import ViserMount

MAP_FILE = "landmarks.db"
STUDIES = "studies"
PROFILES = "profiles"
SENSORS = "sensors.json"


@dataclass(frozen=True)
class ServerOptions:
    """What is decided when the server starts."""

    recordings: Path = Path("recordings")
    recording: Path | None = None
    topic: str | None = None
    map: str | None = None
    device: DeviceOptions = field(default_factory=DeviceOptions)
    say: Callable[[str], None] = lambda sentence: None
    settings: Settings = field(default_factory=Settings)
    max_bytes: int = MAX_BYTES
    hosts: tuple[str, ...] = ()
    token: str | None = None


class State:
    """The parts of one server, wired together; routes ask it for what they need.

    heavy  what takes much memory or time is made for one request at a time; the others wait without a thread
    """

    heavy: CapacityLimiter

    def __init__(self, options: ServerOptions) -> None:
        """Raises RecordingError, TopicError or DeviceError if there is nothing to play."""
        self.recorder = AsyncRecorder()
        self.taps = Taps(scan=self._record, bytes=self.recorder.tap)
        first = _first_source(options, self.taps)
        self._ending = ExitStack()
        self.landmarks = _landmark_store(options, self._ending)
        self.viser = ViserMount()  # after what may be refused: it prints that it has stopped
        folder = options.recordings.parent
        setups = SensorSetups(SensorMemory(folder / SENSORS))
        self._scene = Scene(self.viser.server)
        self.runtime = Runtime(first, options.settings, Navigation(self.landmarks), self._scene.draw, setups)
        self.metrics = Metrics()
        self.map_maker = MapMaker(self.landmarks)
        self.hub = Hub(self.runtime, self.recorder, self.landmarks, self.map_maker, self.metrics.sent)
        self.metrics.observe(self.runtime, self.hub, self.recorder)
        self.repeatability = LiveRepeatability()
        self.calibration = LiveCalibration(self.runtime.player, lambda: self.runtime.ready)
        self.runtime.frame_listeners += [self.repeatability.observe, self.calibration.observe]
        self.runtime.change_listeners.append(self.calibration.check_source)
        self.studies = Studies(folder / STUDIES)
        self.profiles = Profiles(folder / PROFILES)
        self.library = Library(
            options.recordings, options.max_bytes, options.recording, in_use=self._files_in_use
        )
        self.library.remove_abandoned()

    def open(self) -> None:
        """Begin to play, and to deliver on the running event loop."""
        self.heavy = CapacityLimiter(1)
        self.hub.open()
        self.runtime.start()

    def close(self) -> None:
        """End everything, what produces before what is told of it."""
        self.hub.close()
        for part in (self.runtime, self._scene, self.studies, self.map_maker, self.calibration):
            part.close()
        self.recorder.stop()
        self.library.trash.empty()
        self.landmarks.close()
        self._ending.close()
        self.viser.close()

    def _files_in_use(self) -> tuple[Path, ...]:
        return (*self.recorder.files, self.landmarks.atlas.path)

    def _record(self, scan: Scan) -> None:
        """Every scan of a live source is recorded, shown or not, with what the main method finds in it."""
        if self.recorder.running:
            settings = self.runtime.settings
            mask = settings.sensor.mask or ()
            self.recorder.put(scan, extract(masked(scan, mask), settings.extraction), mask)


def _landmark_store(options: ServerOptions, ending: ExitStack) -> LandmarkStore:
    """The file of maps given, else one beside the folder of recordings, or one that `ending` removes."""
    if options.map is not None:
        return LandmarkStore(options.map)
    try:
        return LandmarkStore(options.recordings.parent / MAP_FILE)
    except LandmarkMapError as error:
        options.say(f"{error} Maps are lost when the server ends; give a file for --map to keep them.")
        temporary = ending.enter_context(TemporaryDirectory(prefix="lidarcore-"))
        return LandmarkStore(Path(temporary) / MAP_FILE)


def _first_source(options: ServerOptions, taps: Taps) -> Source:
    """The recording given; else the sensor asked for or connected, else an emulated one, and says which."""
    if options.recording is not None:
        return RecordingSource(options.recording, options.topic)
    source, sentences = connected_or_emulated(options.device, taps)
    for sentence in sentences:
        options.say(sentence)
    return source
