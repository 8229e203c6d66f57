"""Noise and mask of each sensor: set for one, it is not used for another, and a device is known again."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from lidarcore_app.jobs.sensor_memory import MOST, SensorMemory
from lidarcore_app.pipeline.sensor_setups import SensorSetup, SensorSetups
from lidarcore_app.sources.live import DeviceOptions
from lidarcore_app.sources.recorded import RecordingSource
from lidarcore_app.sources.simulated import SimulationSource
from serving import Server, write_room

from lidarcore import SensorNoise
from lidarcore.body_mask import MOST_SECTORS, Sector
from lidarcore.evaluation.calibration.noise_check import SCANS
from lidarcore.rplidar.emulation.options import EmulatorOptions
from lidarcore.simulation.settings import SimulationSettings

NOISE, OTHER = SensorNoise(0.007, 0.002, unevenness=0.003), SensorNoise(0.011, 0.004)
MASK = (Sector(2.0, -2.5, 0.4), Sector(0.1, 0.2, 0.3))
SETUP = SensorSetup(NOISE, MASK)
FULL = SensorSetup(NOISE, tuple(Sector(k / 7, (k + 1) / 7, 1 / 3) for k in range(MOST_SECTORS)))


class Device(SimulationSource):
    """Scans of a simulation, as if a device of that serial number had taken them."""

    kind = "device"

    def __init__(self, serial: str) -> None:
        super().__init__(SimulationSettings())
        self.serial = serial

    @property
    def sensor(self) -> str:
        return f"device S1 {self.serial}"


def test_each_source_has_the_noise_that_was_set_for_it(tmp_path: Path) -> None:
    write_room(tmp_path / "a.npz", scans=2)
    write_room(tmp_path / "b.npz", scans=2)
    one, two = (RecordingSource(tmp_path / name) for name in ("a.npz", "b.npz"))
    simulated = SimulationSource(SimulationSettings(noise=OTHER))
    setups = SensorSetups(SensorMemory(tmp_path / "sensors.json"))
    assert setups.of(simulated) == SensorSetup(OTHER)
    setups.tell(one, SETUP)
    assert setups.of(one) == SETUP
    assert setups.of(two) == SensorSetup(SensorNoise())
    assert not (tmp_path / "sensors.json").exists()


def test_a_device_is_known_again_after_a_restart_by_its_serial_number(tmp_path: Path) -> None:
    file = tmp_path / "new" / "sensors.json"
    SensorSetups(SensorMemory(file)).tell(Device("A"), SETUP)
    again = SensorSetups(SensorMemory(file))
    assert again.of(Device("A")) == SETUP
    assert again.of(Device("B")) == SensorSetup(Device("B").noise)


def test_a_damaged_memory_is_as_good_as_none_and_it_never_grows_beyond_its_bound(tmp_path: Path) -> None:
    memory = SensorMemory(tmp_path / "sensors.json")
    memory.file.write_text('{"device S1 A": {"sigma_range": -1}}')
    assert memory.recall("device S1 A") is None
    for k in range(MOST + 3):
        memory.remember(f"device {k}", FULL)
    assert memory.recall("device 2") is None
    assert memory.recall("device 3") == memory.recall(f"device {MOST + 2}") == FULL


def test_a_memory_of_noises_alone_is_still_known(tmp_path: Path) -> None:
    memory = SensorMemory(tmp_path / "sensors.json")
    memory.file.write_text(
        '{"device S1 A": {"sigma_range": 0.007, "sigma_bearing": 0.002, "unevenness": 0.003}}'
    )
    assert memory.recall("device S1 A") == SensorSetup(NOISE)
    memory.remember("device S1 B", SETUP)
    assert memory.recall("device S1 A") == SensorSetup(NOISE)
    assert memory.recall("device S1 B") == SETUP


def test_another_recording_begins_with_a_noise_of_its_own(make_server: Callable[..., Server]) -> None:
    """And the page is told when what is seen contradicts it."""
    server = make_server()
    write_room(server.folder / "a.npz", scans=60)
    write_room(server.folder / "b.npz", scans=60)

    def sigma() -> float:
        return float(server.get("/settings")["extraction"]["noise"]["sigma_range"])

    server.play(server.folder / "a.npz")
    server.change("PATCH", "/settings", {"extraction": {"noise": {"sigma_range": 0.2}}})
    with server.stream() as stream:
        remark = stream.frame(lambda frame: frame["noise_remark"] is not None)["noise_remark"]
    assert remark.endswith("set to 200.")
    server.play(server.folder / "b.npz")
    assert sigma() == SensorNoise().sigma_range
    server.play(server.folder / "a.npz")
    assert sigma() == 0.2
    assert np.isclose(server.get("/settings")["clusters"]["noise"]["sigma_range"], 0.2)


@pytest.mark.long
def test_the_emulated_sensor_begins_with_the_noise_it_has(make_server: Callable[..., Server]) -> None:
    """So that the first verdict someone sees on the ellipses is on the methods, not on a wrong setting."""
    server = make_server(recording=None, device=DeviceOptions(emulated=True))
    assert SensorNoise(**server.get("/settings")["extraction"]["noise"]) == EmulatorOptions().noise
    with server.stream() as stream:
        frame = stream.frame(lambda frame: frame["sequence"] > 2 * SCANS)
    assert frame["noise_remark"] is None


def test_without_a_memory_that_can_be_written_the_session_goes_on(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    setups = SensorSetups(SensorMemory(tmp_path / "file" / "sensors.json"))
    setups.tell(Device("A"), SETUP)
    assert setups.of(Device("A")) == SETUP


def test_what_is_set_while_another_source_is_being_opened_is_set_for_that_one(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = (RecordingSource(write_room(server.folder / name, scans=2)) for name in ("one.npz", "two.npz"))
    runtime = server.app.state.server.runtime
    runtime.open(one)
    before, opened = runtime.settings.extraction.noise, runtime.player.open

    def meanwhile(*arguments: object) -> None:
        runtime.set({"extraction": {"noise": {"sigma_range": 0.0123}}})
        opened(*arguments)

    with monkeypatch.context() as patched:
        patched.setattr(runtime.player, "open", meanwhile)
        runtime.open(two)
    assert runtime.settings.extraction.noise.sigma_range == 0.0123
    runtime.open(one)
    assert runtime.settings.extraction.noise == before
    runtime.open(two)
    assert runtime.settings.extraction.noise.sigma_range == 0.0123
