"""Playing a sensor, and what is told of it."""

from collections.abc import Callable

from serving import Json, Server, Stream

from lidarcore.rplidar.emulator_process import EmulatorProcess


def watch(server: Server, sensor: EmulatorProcess, **options: object) -> Json:
    """Play the sensor at its port."""
    return server.change("PUT", "/source", {"kind": "device", "port": sensor.port, **options})


def device(stream: Stream, holds: Callable[[Json], object] = bool) -> Json:
    """What is told of the sensor as soon as that holds for it."""
    return stream.state(lambda s: s["source"]["device"] and holds(s["source"]["device"]))["source"]["device"]


def revolutions(stream: Stream, count: int) -> list[Json]:
    """The next frames of a sensor."""
    return [stream.frame(lambda f: f["source"]["kind"] != "recording") for _ in range(count)]


def unbroken(stream: Stream, count: int) -> list[Json]:
    """So many frames of a sensor one after the other: a machine that is busy leaves some out now and then."""
    frames = revolutions(stream, 1)
    for _ in range(30 * count):
        if len(frames) == count:
            break
        (following,) = revolutions(stream, 1)
        follows = following["source"]["index"] == frames[-1]["source"]["index"] + 1
        frames = [*frames, following] if follows else [following]
    assert len(frames) == count, "frames do not follow each other"
    return frames


def settled(stream: Stream, rate: float = 10.0) -> Json:
    """What is told of the sensor once it turns at that rate."""
    return device(stream, lambda d: d["completeness"] == 1 and abs(d["rate_hz"] - rate) < 0.03 * rate)
