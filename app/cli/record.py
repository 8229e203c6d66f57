"""The command `lidarcore record`."""

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import Mode, Rpm, Set, SettingsFile, end_like_ctrl_c, settings_from

if TYPE_CHECKING:
    from lidarcore.rplidar import Driver

    from ..jobs.recorder import AsyncRecorder, RecorderStatus
    from ..pipeline.settings import Settings

LONGEST = 1e8  # s, three years; a timer has an end
ENOUGH = 0.9  # share of the duration asked for that counts as all of it


def record(
    output: Annotated[Path, typer.Argument(help="FILE.mcap, which must not exist yet")],
    port: Annotated[str | None, typer.Option(help="serial port; the connected RPLIDAR if not given")] = None,
    baud: Annotated[
        int, typer.Option(min=1, max=10_000_000, help="baud rate of the sensor; that of an S1 is 256000")
    ] = 256000,
    mode: Mode = None,
    rpm: Rpm = None,
    emulator: Annotated[bool, typer.Option("--emulator", help="record an emulated RPLIDAR S1")] = False,
    duration: Annotated[
        float | None,
        typer.Option(min=0.1, help="how long, in s from the first scan on; until Ctrl-C if not given"),
    ] = None,
    raw: Annotated[Path | None, typer.Option(help="also write the port's raw bytes to this file")] = None,
    settings: SettingsFile = None,
    set_: Set = None,
) -> None:
    """Record a sensor into a file until Ctrl-C, without the page."""
    if emulator and port is not None:
        raise typer.BadParameter("give --port or --emulator, not both.")
    if duration is not None and not duration <= LONGEST:
        raise typer.BadParameter(f"--duration is at most {LONGEST:g} s: leave it out to record until Ctrl-C.")
    from lidarcore import warm_up
    from lidarcore.rplidar import Driver, EmulatorProcess, check_scan_options

    from ..jobs.recorder import AsyncRecorder

    check_scan_options(mode if emulator else None, rpm)  # what modes a real one has it has to be asked
    chosen = settings_from(settings, set_)
    end_like_ctrl_c()
    recorder, troubles = AsyncRecorder(), list[str]()
    with suppress(KeyboardInterrupt), ExitStack() as stack:
        stack.callback(recorder.stop)
        recorder.start(output, raw=raw, ellipse_scale=chosen.view.ellipse_scale)
        warm_up()
        if emulator:
            port = stack.enter_context(EmulatorProcess()).port
        driver = Driver(
            port,
            baud=baud,
            mode=mode,
            rpm=rpm,
            tap=recorder.tap,
            on_change=lambda: troubles.append(driver.error) if driver.error else None,
        )
        stack.enter_context(driver)
        stack.enter_context(_progress(recorder, driver))
        _follow(driver, recorder, duration, chosen)
    _conclude(output, recorder.status, troubles)
    if duration is not None and recorder.status.duration < ENOUGH * duration:
        raise SystemExit(1)


def _follow(
    driver: "Driver", recorder: "AsyncRecorder", duration: float | None, settings: "Settings"
) -> None:
    """Hand scans over until the time is up, also if no more come, or the recorder has failed."""
    from lidarcore import extract
    from lidarcore.body_mask import masked

    mask = settings.sensor.mask or ()
    alarm = threading.Timer(duration or 0, driver.close)
    alarm.daemon = True
    try:
        for scan in driver:
            if duration is not None and alarm.ident is None:
                alarm.start()
            recorder.put(scan, extract(masked(scan, mask), settings.extraction), mask)
            if recorder.status.state == "failed":
                return
    finally:
        alarm.cancel()


@contextmanager
def _progress(recorder: "AsyncRecorder", driver: "Driver") -> Iterator[None]:
    """A line on the terminal, if there is one, that tells how the recording gets on."""
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    console = Console(stderr=True)

    def line() -> Text:
        state = "" if driver.state == "streaming" else f"  {driver.state}"
        return Text(_amount(recorder.status) + state, no_wrap=True)

    if console.is_terminal:
        with Live(get_renderable=line, console=console, transient=True):
            yield
    else:
        yield


def _amount(status: "RecorderStatus") -> str:
    dropped = f", {status.dropped} dropped" if status.dropped else ""
    size, rate = status.size / 1e6, status.rate / 1e3
    return f"{status.scans} scans in {status.duration:.1f} s, {size:.1f} MB, {rate:.0f} kB/s{dropped}"


def _conclude(output: Path, status: "RecorderStatus", troubles: list[str]) -> None:
    """Say what was recorded, and why it may lack something. Raises RecordingError if it ended by itself or is empty."""
    from lidarcore import RecordingError

    if status.error:
        raise RecordingError(status.error)
    if not status.scans:
        raise RecordingError("Nothing was recorded: no scan came.")
    typer.echo(f"{output}: {_amount(status)}")
    for trouble in dict.fromkeys(troubles):
        typer.echo(f"lidarcore: While recording: {trouble}", err=True)
