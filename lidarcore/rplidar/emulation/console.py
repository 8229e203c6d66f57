"""Commands on standard input, a line each, each answered by a line on standard output."""

import inspect
import os
import signal
import stat
from collections.abc import Callable, Mapping

from lidarcore.errors import LidarError

Command = Callable[..., None]

_INPUT = 0  # file descriptor


class Console:
    """Obeys commands by name. Their arguments are numbers; a ValueError or LidarError of theirs becomes the answer."""

    def __init__(self, commands: Mapping[str, Command]) -> None:
        self.listening = True  # there may be more to come
        self._commands = commands
        self._heard = b""
        # Who started us holds the other end of a pipe: when it is gone, so is the reason to run.
        self._is_pipe = stat.S_ISFIFO(os.fstat(_INPUT).st_mode)
        # In the background a terminal cannot be read; that is no reason to stop.
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)

    def fileno(self) -> int:
        """Readable when there is something to obey."""
        return _INPUT

    def obey(self) -> None:
        """Read what is there. At the end of a pipe the command `quit` is given."""
        try:
            heard = os.read(_INPUT, 4096)
        except OSError:
            heard = b""
        self.listening = bool(heard)
        *lines, self._heard = (self._heard + heard).split(b"\n")
        for line in lines:
            print(self._do(line.decode(errors="replace").split()), flush=True)
        if not heard and self._is_pipe:
            self._commands["quit"]()

    def _do(self, words: list[str]) -> str:
        name = words[0] if words else ""
        if name not in self._commands:
            return f"error: no command {name!r}; there are {', '.join(self._commands)}"
        command = self._commands[name]
        try:
            arguments = inspect.signature(command).bind(*map(float, words[1:])).args
        except (TypeError, ValueError):
            return f"error: usage: {name} {inspect.signature(command)}"
        try:
            command(*arguments)
        except (ValueError, LidarError) as error:
            return f"error: {error}"
        return f"ok {' '.join(words)}"
