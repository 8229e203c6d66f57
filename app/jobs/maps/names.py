"""What a map is called in messages, and what its files are named after."""

import re
import unicodedata
from contextlib import suppress

from lidarcore.errors import UnknownSessionError
from lidarcore.landmarks import Atlas, Session

# Windows takes no files of these names, whatever their ending.
_DEVICE = re.compile(r"con|prn|aux|nul|(com|lpt)[0-9¹²³]", re.IGNORECASE)
LONGEST = 50  # characters: with an ending no more than the 255 bytes that file systems take, in any script


def called(session: Session) -> str:
    """A map as a sentence begins: "Hall (map 3)", or "Map 3" without a name."""
    return f"{session.name} (map {session.id})" if session.name else f"Map {session.id}"


def stem_of(atlas: Atlas, session: int) -> str:
    """The name of a session as that of a file, without an ending; "map-3" if it has none, or is gone.

    A name that Windows keeps for a device, CON, becomes "map-CON".
    """
    with suppress(UnknownSessionError):
        plain = _plain(atlas.session(session).name)
        return f"map-{plain}" if _DEVICE.fullmatch(plain) else plain or _numbered(session)
    return _numbered(session)


def _numbered(session: int) -> str:
    return f"map-{session}"


def _plain(name: str) -> str:
    """Letters, digits, - and _ of a name, of any script, with blanks, points and slashes as -."""
    kept = "".join(
        c for c in re.sub(r"[\s./\\]", "-", name) if c in "-_" or unicodedata.category(c)[0] in "LMN"
    )
    return re.sub("-+", "-", kept)[:LONGEST].strip("-")
