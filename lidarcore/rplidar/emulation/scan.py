"""What the emulated sensor measures: a motor that turns, beams into a room, and packets with the time each is due."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from lidarcore.arrays import Array
from lidarcore.rplidar.decoding.packets import FORMATS
from lidarcore.rplidar.emulation.options import EmulatorOptions
from lidarcore.rplidar.protocol import Answer, ScanMode, encode_dense, encode_nodes
from lidarcore.simulation.paths import ROUND, standing, wandering
from lidarcore.simulation.people import Person
from lidarcore.simulation.rooms import furnished_room
from lidarcore.simulation.scene import Optics, Scene

Packet = tuple[float, bytes]  # due (s), and what is sent then
Encode = Callable[[float, Array, Array, Array], bytes]

_BLOCK = 0.1  # s that are simulated at once: a new speed takes effect that late at most
_CAPSULE = FORMATS[Answer.DENSE].samples
_NODES = 16  # legacy nodes sent at once, as a USB adapter gathers them
_SPIN_STEP = 0.01  # s
_STABLE = 0.01  # share of the speed wanted that the motor may be off
_SETTLES = 4.6  # time constants that spin_up is: exp(-4.6) = 0.01


class Motor:
    """Turns clockwise, follows the speed wanted as exp(-t), and is never quite steady."""

    def __init__(self, options: EmulatorOptions, rng: np.random.Generator, now: float) -> None:
        self.wanted = 0.0  # degrees/s
        self.time = now  # s, up to which it has turned
        self._speed = self._angle = 0.0
        self._lag, self._jitter, self._rng = options.spin_up / _SETTLES, options.jitter, rng

    @property
    def is_stable(self) -> bool:
        """Whether the motor turns nearly as fast as it should."""
        return abs(self._speed - self.wanted) <= _STABLE * self.wanted + 1e-9

    def turn(self, n: int, period: float) -> tuple[Array, Array]:
        """Times (n,) s and angles (n,) degrees, 0 to 360, of n samples from now on, `period` s apart."""
        since = period * np.arange(n + 1, dtype=np.float64)
        decay = np.exp(-since[1:] / self._lag) if self._lag else np.zeros(n)
        speeds = self.wanted + (self._speed - self.wanted) * decay
        turned = np.cumsum(speeds * (1 + self._rng.normal(0, self._jitter))) * period
        times, angles = self.time + since, (self._angle + np.concatenate([[0.0], turned])) % 360
        self.time, self._speed, self._angle = float(times[-1]), float(speeds[-1]), float(angles[-1])
        return times[:-1], angles[:-1]

    def coast(self, now: float) -> None:
        """Turn until now, without samples."""
        if now > self.time:
            self.turn(1, now - self.time)


@dataclass(frozen=True, slots=True)
class Room:
    """The scene in front of the emulated sensor since `began` (s), and how it sees it."""

    scene: Scene
    optics: Optics
    rng: np.random.Generator
    began: float

    def measure(self, times: Array, angles: Array) -> tuple[Array, Array]:
        """Distances (N,) mm, 0 for no return, and quality (N,), of beams at clockwise angles (N,) degrees."""
        aimed = np.radians(-angles) + self.rng.normal(0, self.optics.noise.sigma_bearing, len(angles))
        ranges, quality = self.optics.observe(*self.scene.cast(times - self.began, aimed), self.rng)
        return np.nan_to_num(1000 * ranges), quality


def furnished(options: EmulatorOptions, rng: np.random.Generator, now: float) -> Room:
    """The furnished room with people in it, from now on."""
    world = furnished_room().uneven(options.noise, options.seed)
    path = wandering if options.moving else standing
    way = path(np.linspace(0, 2 * ROUND, 100))[:, :2]
    people = [Person(world, rng, way) for _ in range(options.people)]
    optics = Optics(options.noise, options.mixed, options.dropouts)
    room = Room(Scene(world, path, people), optics, rng, now)
    room.measure(np.full(1, now), np.zeros(1))  # compiles what casts the beams, before anyone waits for it
    return room


def packets(mode: ScanMode, motor: Motor, room: Room, baud: int, *, wait: bool) -> Iterator[Packet]:
    """Endless packets of a scan from the motor's time on; if it waits, only once the motor is stable."""
    while wait and not motor.is_stable:
        motor.coast(motor.time + _SPIN_STEP)
    encode, samples = _ENCODERS[mode.answer_type]
    size = FORMATS[Answer(mode.answer_type)].size
    period = mode.us_per_sample * 1e-6
    delay = 1.5 * period + 10 * size / baud  # from a sample to its arrival, as Slamtec's SDK has it
    count = round(_BLOCK / (samples * period))
    before = np.nan
    while True:
        times, angles = motor.turn(count * samples, period)
        distances, quality = room.measure(times, angles)
        data = encode(before, angles, distances, quality)
        before = angles[-1]
        due = times[samples - 1 :: samples] + delay
        yield from zip(due.tolist(), _split(data, len(data) // count), strict=True)


def _encode_dense(before: float, angles: Array, distances: Array, quality: Array) -> bytes:
    """Capsules of a block; the very first one, with nothing before it, says so."""
    starts = angles[::_CAPSULE]
    is_first = np.isnan(before) & (np.arange(len(starts)) == 0)
    return encode_dense(starts, distances.reshape(-1, _CAPSULE), is_first)


def _encode_nodes(before: float, angles: Array, distances: Array, quality: Array) -> bytes:
    """Nodes of a block, a flag on each that opens a revolution."""
    angles = np.floor(64 * angles) / 64  # what is rounded up to a full turn would wrap before its flag
    return encode_nodes(angles, distances, quality, np.diff(angles, prepend=before) < 0)


def _split(data: bytes, size: int) -> Iterator[bytes]:
    return (data[at : at + size] for at in range(0, len(data), size))


# Of each answer type: how a block is encoded, and samples sent at once.
_ENCODERS: dict[int, tuple[Encode, int]] = {
    Answer.NODES: (_encode_nodes, _NODES),
    Answer.DENSE: (_encode_dense, _CAPSULE),
}
