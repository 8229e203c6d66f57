import http.client
import os
import pickle
import socket
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from lidarcore_app.errors import NotFoundError
from lidarcore_app.sources.trash import Trash
from serving import Server, assert_problem, chosen, wait_until, write_room

from lidarcore import open_recording

BAD_NAMES = [
    "../up.npz", "%2e%2e%2fup.npz", "..%5cup.npz", "a%2fb.npz", "%2fetc%2fup.npz", ".hidden", "..", "%2e%2e",
    "nul%00.npz", "c%3a.npz", "trailing.", "x" * 250, "line%0abreak", "tilde%2f~",
]  # fmt: skip


def files(folder: Path) -> list[str]:
    """Everything below the folder's parent: what was written, wherever it went; files may vanish meanwhile."""
    found = (
        Path(where) / name for where, folders, names in os.walk(folder.parent) for name in (*folders, *names)
    )
    return sorted(str(path.relative_to(folder.parent)) for path in found)


def test_an_uploaded_recording_is_listed_plays_and_can_be_deleted(server: Server, tmp_path: Path) -> None:
    source = write_room(tmp_path / "source.npz")
    response = server.http.put("/recordings/my room.npz", content=source.read_bytes())
    assert response.status_code == 201
    entry = response.json()
    assert server.recordings() == [entry]
    assert (entry["name"], entry["size"], entry["builtin"]) == ("my room.npz", source.stat().st_size, False)
    assert (server.folder / "my room.npz").read_bytes() == source.read_bytes()
    assert server.play(server.folder / "my room.npz", paused=True)["stamp"] == 100
    assert server.get("/source")["recording"] == "my room.npz"
    assert server.http.delete("/recordings/my room.npz").status_code == 204
    assert server.recordings() == []
    assert_problem(server.http.delete("/recordings/my room.npz"), 404)


def test_a_real_bag_is_taken_and_plays(server: Server, hokuyo: Path) -> None:
    with hokuyo.open("rb") as file:
        assert server.http.put("/recordings/demo.bag", content=file).status_code == 201
    frame = server.play(server.folder / "demo.bag")
    assert frame["n_beams"] == 681
    assert frame["corners"]


def test_an_existing_recording_is_replaced_only_when_asked_for(
    server: Server, room: Path, tmp_path: Path
) -> None:
    old, new = room.read_bytes(), write_room(tmp_path / "new.npz", scans=3).read_bytes()
    assert_problem(server.http.put("/recordings/room.npz", content=new), 409)
    assert room.read_bytes() == old
    assert server.http.put("/recordings/room.npz?overwrite=true", content=new).status_code == 201
    assert room.read_bytes() == new


@pytest.mark.parametrize("chunked", [False, True])
def test_too_large_an_upload_is_refused_and_leaves_nothing(
    make_server: Callable[..., Server], chunked: bool
) -> None:
    server = make_server(max_bytes=100_000)
    body = b"x" * 150_000
    content = iter([body[:90_000], body[90_000:]]) if chunked else body
    problem = assert_problem(server.http.put("/recordings/big.npz", content=content), 413)
    assert "100000" in problem["detail"]
    assert files(server.folder) == ["recordings"]
    assert server.get("/recordings")["max_bytes"] == 100_000


class Malicious:
    def __reduce__(self) -> tuple:
        return (Path.touch, (Path("pwned"),))


def pickled_npz(path: Path) -> bytes:
    with path.open("wb") as file:
        np.savez(file, ranges=np.array([Malicious()], dtype=object), bearings=np.zeros(1))
    data = path.read_bytes()
    path.unlink()
    return data


@pytest.mark.parametrize("kind", ["garbage", "empty", "pickle", "raw pickle", "truncated"])
def test_what_no_reader_takes_is_refused_with_its_reason_and_leaves_nothing(
    server: Server, tmp_path: Path, kind: str
) -> None:
    body = {
        "garbage": np.random.default_rng(0).bytes(50_000),
        "empty": b"",
        "pickle": pickled_npz(tmp_path / "pickled.npz"),
        "raw pickle": pickle.dumps(Malicious()),
        "truncated": write_room(tmp_path / "whole.npz").read_bytes()[:3000],
    }[kind]
    for path in tmp_path.glob("*.npz"):
        path.unlink()
    before = server.next_frame()
    problem = assert_problem(server.http.put("/recordings/bad.bag", content=body), 422)
    assert "bad.bag" in problem["detail"] or "pickle" in problem["detail"]
    assert ".upload" not in problem["detail"]
    assert files(server.folder) == ["recordings"]
    assert not Path("pwned").exists()
    after = server.next_frame()
    assert not chosen(after)
    assert after["sequence"] > before["sequence"]


@pytest.mark.parametrize("name", BAD_NAMES)
@pytest.mark.parametrize("method", ["PUT", "DELETE"])
def test_a_name_that_is_no_plain_file_name_touches_nothing(
    shared_server: Server, name: str, method: str
) -> None:
    folder = shared_server.folder
    before, body = files(folder), (folder / "room.npz").read_bytes()
    connection = http.client.HTTPConnection("127.0.0.1", shared_server.port)
    connection.request(method, f"/api/v1/recordings/{name}", body=body if method == "PUT" else None)
    response = connection.getresponse()
    assert response.status in (404, 405, 422)
    assert response.headers["content-type"] == "application/problem+json"
    connection.close()
    assert files(folder) == before


def test_an_upload_that_breaks_off_leaves_nothing(server: Server, room: Path) -> None:
    before = files(server.folder)
    with socket.create_connection(("127.0.0.1", server.port)) as connection:
        head = f"PUT /api/v1/recordings/half.npz HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        connection.sendall(f"{head}Content-Length: 1000000\r\n\r\n".encode() + room.read_bytes()[:100_000])
        wait_until(lambda: files(server.folder) != before)
    wait_until(lambda: files(server.folder) == before)


def test_a_recording_given_at_the_start_plays_and_is_listed_but_not_deleted(
    make_server: Callable[..., Server], tmp_path: Path
) -> None:
    given = write_room(tmp_path / "elsewhere.npz")
    server = make_server(recording=given)
    assert server.next_frame()["stamp"] < 200
    assert [r["name"] for r in server.get("/recordings")["recordings"] if not r["builtin"]] == [
        "elsewhere.npz"
    ]
    assert_problem(server.http.delete("/recordings/elsewhere.npz"), 409)
    assert_problem(server.http.put("/recordings/elsewhere.npz?overwrite=1", content=given.read_bytes()), 409)
    assert given.exists()
    write_room(server.folder / "other.npz", since=500)
    assert server.play(server.folder / "other.npz", paused=True)["stamp"] == 500
    assert server.get("/source")["recording"] == "other.npz"
    with server.stream() as stream:
        server.change("PUT", "/source", {"kind": "recording", "name": given.name})
        assert server.get("/source")["recording"] == given.name
        assert stream.frame(lambda frame: frame["stamp"] < 200)


def test_hidden_files_and_other_folders_are_not_listed_but_bags_are(server: Server, room: Path) -> None:
    (server.folder / ".hidden").write_text("x")
    (server.folder / "folder").mkdir()
    bag = server.folder / "bag"
    bag.mkdir()
    (bag / "bag_0.db3").write_bytes(b"SQLite format 3\0")
    assert [r["name"] for r in server.recordings()] == ["bag", "room.npz"]
    assert server.http.delete("/recordings/bag").status_code == 204
    assert_problem(server.http.delete("/recordings/folder"), 404)
    assert (server.folder / "folder").is_dir()


def test_what_was_deleted_can_be_taken_back_until_it_is_gone(server: Server, room: Path) -> None:
    before = room.read_bytes()
    assert server.http.delete("/recordings/room.npz").status_code == 204
    assert server.recordings() == []
    entry = server.http.post("/recordings/room.npz/restore").raise_for_status().json()
    assert server.recordings() == [entry]
    assert room.read_bytes() == before
    assert files(server.folder) == ["recordings", "recordings/room.npz"]
    assert_problem(server.http.post("/recordings/none.npz/restore"), 404)
    assert server.http.delete("/recordings/room.npz").status_code == 204
    room.write_bytes(before)
    assert_problem(server.http.post("/recordings/room.npz/restore"), 409)
    server.stop()
    assert files(server.folder) == ["recordings", "recordings/room.npz"]


def test_the_trash_keeps_what_was_deleted_last_and_empties_itself(tmp_path: Path) -> None:
    file = tmp_path / "room.npz"
    trash = Trash(undo_within=0.5)
    for text in ("old", "new"):
        file.write_text(text)
        trash.put(file)
    trash.take_back(file)
    assert file.read_text() == "new"
    wait_until(lambda: [path.name for path in tmp_path.iterdir()] == ["room.npz"])
    with pytest.raises(NotFoundError, match=r"kept for only 0\.5 s"):
        trash.take_back(file)


def test_a_recording_gets_another_name(server: Server, room: Path) -> None:
    demo = next(r["name"] for r in server.get("/recordings")["recordings"] if r["builtin"])
    other = write_room(server.folder / "other.npz").read_bytes()
    for name, new, status in (
        ("none.npz", "new.npz", 404),
        (demo, "new.npz", 409),
        ("room.npz", "other.npz", 409),
        ("room.npz", "../up.npz", 422),
        ("room.npz", ".hidden", 422),
    ):
        assert_problem(server.http.patch(f"/recordings/{name}", json={"name": new}), status)
    entry = server.http.patch("/recordings/room.npz", json={"name": "hall 1.npz"}).raise_for_status().json()
    assert entry["name"] == "hall 1.npz"
    assert files(server.folder) == ["recordings", "recordings/hall 1.npz", "recordings/other.npz"]
    assert (server.folder / "other.npz").read_bytes() == other


def test_a_recording_is_downloaded_as_it_is_and_says_what_it_holds(server: Server, room: Path) -> None:
    answer = server.http.get("/recordings/room.npz")
    assert answer.content == room.read_bytes()
    assert 'attachment; filename="room.npz"' in answer.headers["content-disposition"]
    scans = list(open_recording(room))
    wanted = {"scans": len(scans), "duration": scans[-1].stamp - scans[0].stamp, "problem": None}
    found = server.get("/recordings/room.npz/facts")
    assert found.items() >= wanted.items()
    assert found["format"]
    assert found["sensor"] is None  # .npz files do not say
    assert server.get("/recordings/emulated-s1.mcap/facts")["sensor"] == "RPLIDAR S1"
    (server.folder / "bad.bag").write_bytes(b"nothing")
    found = server.get("/recordings/bad.bag/facts")
    assert (found["scans"], found["duration"]) == (None, None)
    assert "bad.bag" in found["problem"]
    (server.folder / "folder").mkdir()
    (server.folder / "folder" / "bag_0.db3").write_bytes(b"SQLite format 3\0")
    assert_problem(server.http.get("/recordings/folder"), 409)
    assert_problem(server.http.get("/recordings/none.npz"), 404)
