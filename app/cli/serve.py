"""The command `lidarcore serve`."""

import errno
import re
from pathlib import Path
from typing import Annotated

import typer

from .options import Mode, Rpm, Set, SettingsFile, Topic, named_folder, settings_from

Recording = Annotated[
    Path | None,
    typer.Argument(
        help="recording to play; if not given, the connected sensor, or an emulated one if there is none"
    ),
]
Host = Annotated[str, typer.Option(help="address to listen on; a token is needed unless it is local")]
HttpPort = Annotated[int, typer.Option(min=0, max=65535, help="port of the dashboard; 0 takes any free one")]
Port = Annotated[
    str | None,
    typer.Option(
        help="serial port of the sensor, such as /dev/ttyUSB0; a mere number is taken as --http-port"
    ),
]
Baud = Annotated[
    int | None, typer.Option(min=1200, max=10_000_000, help="baud rate of the sensor; 256000 if not given")
]
Emulated = Annotated[bool, typer.Option("--emulator", help="use an emulated sensor, whatever is connected")]
Recordings = Annotated[
    Path,
    typer.Option(metavar="FOLDER", parser=named_folder, help="folder of recordings, and where uploads go"),
]
Maps = Annotated[
    str | None,
    typer.Option(
        "--map",
        metavar="FILE",
        help="file of landmark maps; landmarks.db beside the folder of recordings if not given",
    ),
]
MaxUpload = Annotated[int, typer.Option(min=1, max=1_000_000, help="largest upload, MB")]
Token = Annotated[
    str | None,
    typer.Option(
        envvar="LIDARCORE_TOKEN",
        help="token that requests must carry; a random one is made where one is needed",
    ),
]
AllowHost = Annotated[list[str] | None, typer.Option(help="another name by which this server is reached")]
OpenBrowser = Annotated[bool, typer.Option("--open-browser", help="open the page in the browser")]


def serve(
    recording: Recording = None,
    topic: Topic = None,
    host: Host = "127.0.0.1",
    http_port: HttpPort = 8000,
    port: Port = None,
    baud: Baud = None,
    mode: Mode = None,
    rpm: Rpm = None,
    emulator: Emulated = False,
    recordings: Recordings = Path("recordings"),
    map: Maps = None,
    max_upload: MaxUpload = 1024,
    token: Token = None,
    allow_host: AllowHost = None,
    settings: SettingsFile = None,
    set_: Set = None,
    open_browser: OpenBrowser = False,
) -> None:
    """Serve the dashboard."""
    from ..web.serving import listen, run, secured

    if port is not None and port.isdecimal():
        http_port, port = int(port), None
    if sum(given not in (None, False) for given in (recording, port, emulator)) > 1:
        raise typer.BadParameter("give one of RECORDING, --port and --emulator.")
    if recordings.exists() and not recordings.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is not a folder: give one for --recordings", str(recordings))
    with listen(host, http_port) as listening:
        from ..sources.live import DeviceOptions
        from ..web.state import ServerOptions

        options = ServerOptions(
            recordings=recordings,
            recording=recording,
            topic=topic,
            map=map,
            device=DeviceOptions(port, baud, mode, rpm, emulator),
            say=lambda sentence: print(sentence, flush=True),
            settings=settings_from(settings, set_),
            max_bytes=max_upload << 20,
            hosts=tuple(allow_host or ()),
            token=_plain(token),
        )
        run(secured(options, host), listening, host, open_browser=open_browser)


def _plain(token: str | None) -> str | None:
    """The token, if it can stand in an address, a header and a cookie as it is; none if it is empty."""
    if token and not re.fullmatch(r"[A-Za-z0-9._~-]+", token):
        raise typer.BadParameter("a token may hold only letters, digits and - . _ ~: choose another one.")
    return token or None
