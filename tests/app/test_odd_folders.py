"""Folders of recordings and profiles as people have them: links that lead nowhere, pipes, names of other systems."""

import os
import time
from pathlib import Path

import pytest
from lidarcore_app.sources.library import ABANDONED, Library
from serving import Server, assert_problem, wait_until, write_room


def make_odd_entries(folder: Path, suffix: str) -> None:
    """Everything that is no plain file of a name that can be asked for."""
    folder.mkdir(exist_ok=True)
    os.mkfifo(folder / f"pipe{suffix}")
    (folder / f"nowhere{suffix}").symlink_to("nothing")
    (folder / f"loop{suffix}").symlink_to(f"loop{suffix}")
    Path(os.fsdecode(os.fsencode(folder) + b"/latin-\xe9" + suffix.encode())).touch()
    (folder / f"line\nbreak{suffix}").touch()


def test_odd_entries_do_not_hide_the_recordings(server: Server, room: Path) -> None:
    make_odd_entries(server.folder, ".mcap")
    bag = server.folder / "bag"
    make_odd_entries(bag, ".mcap")
    write_room(bag / "inside.mcap")
    assert {entry["name"] for entry in server.get("/recordings")["recordings"]} >= {room.name, "bag"}


def test_recordings_that_are_not_listed_for_their_names_are_named(server: Server, room: Path) -> None:
    make_odd_entries(server.folder, ".mcap")
    content = room.read_bytes()
    for name in ("a<b.npz", "blank ", "ü" * 101, ".hidden.npz"):
        (server.folder / name).write_bytes(content)
    bag = server.folder / "bag?"
    bag.mkdir()
    (bag / "inside.mcap").write_bytes(content)
    (server.folder / "folder?").mkdir()
    found = server.get("/recordings")
    unlisted = ["a<b.npz", "bag?", "blank ", "line\nbreak.mcap", "latin-\\udce9.mcap", "ü" * 101]
    assert sorted(found["unlisted"]) == sorted(unlisted)
    listed = {one["name"] for one in found["recordings"]}
    assert room.name in listed
    assert not listed & {*unlisted, ".hidden.npz", "folder?"}
    for name in ("a<b.npz", "ü" * 101):
        asked = server.http.put(f"/recordings/{name}", content=content)
        assert 'leave out / \\ : * ? " < > |' in assert_problem(asked, 422)["detail"]


def test_odd_entries_do_not_hide_the_profiles(server: Server) -> None:
    server.change(
        "PUT", "/profiles/mine", {"extraction": {"noise": {"sigma_range": 0.01, "sigma_bearing": 0.001}}}
    )
    make_odd_entries(server.folder.parent / "profiles", ".json")
    listed = {entry["name"]: entry for entry in server.get("/profiles")["profiles"]}
    assert listed["mine"]["noise"]["sigma_range"] == 0.01
    assert "not a file" in listed["pipe"]["problem"]
    assert "latin-\udce9" not in listed


def test_a_recording_that_vanishes_while_it_is_listed_is_left_out(tmp_path: Path, monkeypatch) -> None:
    room, gone = write_room(tmp_path / "room.npz"), write_room(tmp_path / "gone.npz")
    library = Library(tmp_path, builtin=())
    original = Path.is_file

    def deleting(path: Path) -> bool:
        found = original(path)
        gone.unlink(missing_ok=True)
        return found

    monkeypatch.setattr(Path, "is_file", deleting)
    assert [entry.name for entry in library.list()] == [room.name]


@pytest.mark.long
def test_what_is_being_recorded_is_neither_deleted_nor_replaced(watching: Server, tmp_path: Path) -> None:
    watching.change("POST", "/recorder/start", {"name": "hall.mcap", "raw": True})
    room = write_room(tmp_path / "room.npz").read_bytes()
    for name in ("hall.mcap", "hall.rplidar"):
        assert_problem(watching.http.delete(f"/recordings/{name}"), 409)
        assert_problem(watching.http.put(f"/recordings/{name}?overwrite=true", content=room), 409)
    wait_until(lambda: watching.get("/recorder")["scans"] > 3)
    assert watching.change("POST", "/recorder/stop", None)["error"] is None
    assert watching.http.delete("/recordings/hall.mcap").status_code == 204


def test_uploads_that_a_killed_server_left_are_removed_and_running_ones_are_not(tmp_path: Path) -> None:
    old, new = tmp_path / ".upload-old", tmp_path / ".upload-new"
    for folder in (old, new):
        folder.mkdir()
        (folder / "room.npz").touch()
    before = time.time() - 2 * ABANDONED
    for path in (old / "room.npz", old):
        os.utime(path, (before, before))
    Library(tmp_path, builtin=()).remove_abandoned()
    assert [path.name for path in tmp_path.iterdir()] == [new.name]
