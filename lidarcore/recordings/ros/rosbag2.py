"""ROS 2 bags: a directory, or one of its files by itself, as sqlite3 or MCAP."""

import re
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from lidarcore.body_mask import from_text
from lidarcore.errors import MaskError, RecordingError
from lidarcore.files.foreign_database import bound, stores_its_columns
from lidarcore.files.streams import DAMAGE, MEBIBYTE, ZSTD, Unpacker, is_packed, open_stream, read_head
from lidarcore.recordings.ros.mcap import MASK, SENSOR, McapReader
from lidarcore.recordings.ros.messages import MOST_TOPICS, WANTED, Message, check_topics, plain_type
from lidarcore.recordings.ros.recording import RosRecording

SQLITE = b"SQLite format 3\x00"


class Rosbag2(RosRecording):
    """A ROS 2 bag, with or without metadata.yaml; files and messages may be packed with zstd."""

    name = "ROS 2 bag"
    signature = re.compile(rb"\ASQLite format 3\x00|\A\x89MCAP0\r\n")

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Say whether the file is of this format, or the directory holds such files."""
        return bool(_storage_files(path)) if path.is_dir() else super().recognises(path, head)

    def _open(self, topic: str | None) -> None:
        self._metadata: dict[str, str] = {}
        super()._open(topic)
        self.sensor = self._metadata.get(SENSOR)
        try:
            self.mask = from_text(self._metadata.get(MASK, "[]"))
        except MaskError as error:
            self._remark(f"{error} It is left out.")

    def _messages(self, connections: dict[str, str]) -> Iterator[Message]:
        files = _storage_files(self.path) if self.path.is_dir() else [self.path]
        if len(files) > 1 and not (self.path / "metadata.yaml").exists():
            names = ", ".join(file.name for file in files)
            raise RecordingError(
                f"{self.path.name} has no metadata.yaml, but several files: open one of {names}."
            )
        for file in files:
            unpacker = Unpacker(file)
            for message in self._stored(file, unpacker, connections):
                try:
                    packed = message.data.startswith(ZSTD)  # no encoding of ROS begins like that
                    yield message._replace(data=unpacker.unpack("zstd" if packed else "", message.data))
                except DAMAGE:
                    self._count("damaged messages left out", 1)

    def _stored(self, file: Path, unpacker: Unpacker, connections: dict[str, str]) -> Iterator[Message]:
        if read_head(file).startswith(SQLITE):
            yield from self._rows(file, connections)
        else:
            reader = McapReader(unpacker, self._remark, self._count, connections)
            with open_stream(file, self._remark) as stream:
                yield from reader.messages(stream)
            self._metadata |= reader.metadata

    def _rows(self, file: Path, connections: dict[str, str]) -> Iterator[Message]:
        """Yield the messages in the order of recording, up to the first damaged page."""
        with closing(self._database(file)) as database:
            try:
                topics = _topics(database, file.name)
                connections |= {name: type_ for name, type_ in topics.values()}
                check_topics(len(connections))
                wanted = [topic for topic, (_, type_) in topics.items() if type_ in WANTED]
                marks = ",".join("?" * len(wanted))
                query = "SELECT id, topic_id, timestamp, data FROM messages WHERE topic_id IN"
                last = -1
                for row, topic, time, data in database.execute(f"{query} ({marks}) ORDER BY id", wanted):
                    if row <= last:
                        raise sqlite3.DatabaseError("rows repeat")
                    last = row
                    if not isinstance(data, bytes) or not isinstance(time, int):
                        self._count("damaged rows left out", 1)
                    else:
                        yield Message(*topics[topic], "cdr", time * 1e-9, data)
            except sqlite3.DatabaseError:
                self._remark("The database is damaged or cut short: everything before is read.")

    def _database(self, file: Path) -> sqlite3.Connection:
        """Open read-only, without locks or side files; a packed database is unpacked into a temporary file."""
        with file.open("rb") as start:
            packed = is_packed(start.read(4))
        with tempfile.TemporaryDirectory(prefix="lidarcore-bag-", ignore_cleanup_errors=True) as folder:
            if packed:
                file = self._unpacked(file, Path(folder) / "bag.db3")
            uri = f"file:{quote(str(file.absolute()))}?mode=ro&immutable=1"
            database = sqlite3.connect(uri, uri=True, check_same_thread=False)
            size = file.stat().st_size
        # The file is open, and gone with the process, however that ends; Windows keeps it until then.
        database.execute("PRAGMA writable_schema = ON")  # opens a database that is cut short, too
        bound(database, size)
        return database

    def _unpacked(self, file: Path, plain: Path) -> Path:
        with open_stream(file, self._remark) as stream, plain.open("xb") as out:
            shutil.copyfileobj(stream, out, MEBIBYTE)
        return plain


def _topics(database: sqlite3.Connection, name: str) -> dict[int, tuple[str, str]]:
    """Name and type of each topic id. Raises RecordingError if the tables of a bag are not there.

    Views, virtual tables and computed columns in their place could make the database compute for ever.
    """
    if not all(stores_its_columns(database, table) for table in ("topics", "messages")):
        raise RecordingError(
            f"{name} is an SQLite database, but not a ROS 2 bag: it lacks the tables topics and messages."
        )
    rows = database.execute("SELECT id, name, type FROM topics ORDER BY id LIMIT ?", (MOST_TOPICS + 1,))
    return {id_: (str(name), plain_type(str(type_))) for id_, name, type_ in rows}


def _storage_files(directory: Path) -> list[Path]:
    """List the bag's files in the order of recording: the numbers in their names count up."""
    files = [
        file for file in directory.iterdir() if file.is_file() and Rosbag2.signature.match(read_head(file))
    ]
    return sorted(
        files,
        key=lambda file: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", file.name)],
    )
