"""An emulated RPLIDAR S1 on a pseudo-terminal: `python -m lidarcore.rplidar.emulator --help`."""

import select
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from lidarcore.errors import LidarError
from lidarcore.rplidar.emulation.console import Console
from lidarcore.rplidar.emulation.device import Device, EmulatedS1
from lidarcore.rplidar.emulation.faults import Faults
from lidarcore.rplidar.emulation.options import FIRST_LINE, EmulatorOptions, parse
from lidarcore.rplidar.emulation.pseudo_terminal import PseudoTerminal
from lidarcore.rplidar.emulation.replay import Replay, ReplayedS1
from lidarcore.rplidar.emulation.scan import furnished
from lidarcore.rplidar.protocol import Health

_MOST_GARBAGE = 1 << 16  # bytes
_LONGEST_WAIT = 60.0  # s


class Emulator:
    """An S1 at the other end of a port, and a line between them that may be bad."""

    def __init__(self, options: EmulatorOptions, terminal: PseudoTerminal) -> None:
        self._options, self._terminal = options, terminal
        self._rng = np.random.default_rng(options.seed)
        self._faults = Faults(options.flip, options.lose, options.lose_bytes, self._rng)
        self._room = furnished(options, self._rng, time.monotonic())
        self._replay = None if options.replay is None else Replay(options.replay)
        self._device = self._boot()
        self._stalled_until = 0.0
        self._running = True
        self._console = Console(
            {
                "unplug": self._unplug,
                "replug": self._replug,
                "stall": self._stall,
                "flip": partial(self._worsen, "flip"),
                "lose": partial(self._worsen, "lose"),
                "lose-bytes": partial(self._worsen, "lose_bytes"),
                "garbage": self._garbage,
                "health": self._health,
                "quit": self.quit,
            }
        )

    def run(self) -> None:
        """Until told to quit; obeys what is written to standard input."""
        while self._running:
            ready = self._wait()
            if self._console in ready:
                self._console.obey()
            if self._terminal.plugged:
                if self._terminal in ready:
                    self._hear()
                self._send_due()

    def quit(self) -> None:
        """Make `run` return."""
        self._running = False

    def _wait(self) -> list[Console | PseudoTerminal]:
        """Until there is something to read or to send; what can be read."""
        sources: list[Console | PseudoTerminal] = [self._console] if self._console.listening else []
        if self._terminal.plugged:
            sources.append(self._terminal)
        patience = min(max(self._device.due - time.monotonic(), 0), _LONGEST_WAIT)
        return select.select(sources, [], [], patience)[0]

    def _hear(self) -> None:
        data = self._terminal.read()
        if self._speed_fits():
            self._send(self._device.receive(data, time.monotonic()))

    def _send_due(self) -> None:
        now = time.monotonic()
        while self._device.due <= now:
            packet = self._device.take()
            if now >= self._stalled_until:
                self._send(self._faults.damage(packet, self._device.packet_size))

    def _send(self, data: bytes) -> None:
        """Send bytes as the client hears them: garbage if it listens at another speed."""
        self._terminal.write(data if self._speed_fits() else self._rng.bytes(len(data)))

    def _speed_fits(self) -> bool:
        return self._terminal.baud in (None, self._options.baud)

    def _boot(self) -> Device:
        now = time.monotonic()
        if self._replay is not None:
            return ReplayedS1(self._options, self._replay, self._room, now)
        return EmulatedS1(self._options, self._room, now)

    def _unplug(self) -> None:
        self._terminal.unplug()
        self._device = Device()

    def _replug(self) -> None:
        self._unplug()
        self._terminal.plug()
        self._options = replace(self._options, streaming=False)  # as one is when the power comes
        self._device = self._boot()

    def _stall(self, seconds: float) -> None:
        """No measurements for so long, as when the motor is held."""
        self._stalled_until = time.monotonic() + seconds

    def _worsen(self, fault: str, share: float) -> None:
        if not 0 <= share <= 1:
            raise ValueError("a share is from 0 to 1")
        setattr(self._faults, fault, share)

    def _garbage(self, count: float) -> None:
        """Bytes that mean nothing, between two packets."""
        if not 0 <= count <= _MOST_GARBAGE:
            raise ValueError(f"give 0 to {_MOST_GARBAGE} bytes")
        if self._terminal.plugged:
            self._send(self._rng.bytes(int(count)))

    def _health(self, status: float, code: float = 0) -> None:
        if status not in range(len(Health.NAMES)) or code not in range(1 << 16):
            raise ValueError("the status is 0, 1 or 2, the code 0 to 65535")
        self._device.set_health(Health(int(status), int(code)))


def run_emulator(options: EmulatorOptions) -> None:
    """Emulate until told to quit by a line, a signal or the end of a pipe. Raises DeviceError."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with tempfile.TemporaryDirectory(prefix="rplidar-") as folder:
        terminal = PseudoTerminal(options.link or Path(folder) / "ttyS1")
        try:
            emulator = Emulator(options, terminal)
            print(f"{FIRST_LINE}{terminal.link}", flush=True)
            emulator.run()
        except KeyboardInterrupt:
            return
        finally:
            terminal.unplug()


def main(
    arguments: Sequence[str] | None = None, program: str = "python -m lidarcore.rplidar.emulator"
) -> None:
    """The command line."""
    options = parse(sys.argv[1:] if arguments is None else arguments, program)
    try:
        run_emulator(options)
    except (LidarError, OSError) as error:
        print(f"lidarcore: {error}", file=sys.stderr)
        raise SystemExit(2) from None


if __name__ == "__main__":
    main()
