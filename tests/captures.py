"""All that a raw capture holds."""

from pathlib import Path

from lidarcore.rplidar.capture import Piece, read_pieces, read_stream


def read_capture(path: Path) -> list[Piece]:
    """The records of a capture of which the first line was read."""
    with path.open("rb") as file:
        read_stream(file)
        return list(read_pieces(file))
