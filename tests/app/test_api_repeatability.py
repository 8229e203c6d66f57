"""Repeatability beside the live view: what the library finds in the same scans, and when it begins anew."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lidarcore_app.jobs.repeatability import LiveRepeatability
from lidarcore_app.pipeline.frame import Frame
from lidarcore_app.web.routes.repeatability import OFF
from pydantic_core import to_json
from serving import Json, Server, assert_problem, room_ranges, strict_json, write_room
from waiting import wait_until

from lidarcore import Client, ExtractionSettings, compare, open_recording
from lidarcore.evaluation.repeatability.statistics import Repeatability
from lidarcore.evaluation.repeatability.tables import to_csv

ON = {"repeatability": {"running": True}}


def found(server: Server) -> Json:
    return strict_json(server.http.get("/repeatability").raise_for_status().text)


def scans(server: Server, count: int) -> Json:
    """What is found once it has so many scans."""
    wait_until(lambda: found(server)["scans"] == count, f"{count} scans are in the window")
    return found(server)


def step(server: Server, count: int, since: int) -> Json:
    """One scan after the other."""
    for _ in range(count):
        show(server, 1)
    return scans(server, since + count)


def show(server: Server, by: int) -> None:
    """Step so many scans, and wait until that one is worked on."""
    index = server.change("POST", "/source/step", {"by": by})["index"]
    wait_until(lambda: server.runtime.frame.timed.position.index == index)


def by_hand(path: Path, indices: range, **settings: Any) -> Repeatability:
    study = Repeatability()
    for scan in islice(open_recording(path), indices.start, indices.stop):
        study.add(compare(scan, ExtractionSettings(**settings)))
    return study


def as_told(study: Repeatability) -> Json:
    return {"running": True, **strict_json(to_json(study.summary(), inf_nan_mode="null"))}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory, background: Path) -> Iterator[Server]:
    """One for all: every test begins with a source of its own."""
    folder = tmp_path_factory.mktemp("repeatability")
    write_room(folder / "room.npz", scans=60)
    one = Server(folder, recording=background)
    yield one
    one.stop()


@pytest.fixture
def standing(server: Server) -> Server:
    """It has watched the first twelve scans of a room, and is paused."""
    server.change("PATCH", "/settings", dict.fromkeys(("extraction", "view", "repeatability")))
    server.change("PATCH", "/settings", ON)
    server.change("PATCH", "/source", {"loop": True, "speed": 1})
    server.play(server.folder / "room.npz", paused=True)
    scans(server, 1)
    step(server, 11, since=1)
    return server


def test_it_is_off_until_someone_wants_it(make_server: Callable[..., Server]) -> None:
    server = make_server()
    server.next_frame()
    told = found(server)
    assert (told["running"], told["scans"], told["message"]) == (False, 0, OFF)
    assert {method["verdict"] for one in told["methods"] for method in one["claims"].values()} == {None}
    assert_problem(server.http.get("/repeatability/corners/1"), 404)


def test_it_tells_what_the_library_finds_in_the_same_scans(standing: Server) -> None:
    path = standing.folder / "room.npz"
    study = by_hand(path, range(12))
    assert found(standing) == as_told(study)
    step(standing, 18, since=12)
    study = by_hand(path, range(30))
    told = found(standing)
    assert told == as_told(study)
    assert len(told["methods"]) == 6
    assert told["message"] is None
    assert {corner["count"] for method in told["methods"] for corner in method["corners"]} == {30}
    table = standing.http.get("/repeatability", params={"format": "csv"})
    assert table.headers["content-disposition"] == 'attachment; filename="repeatability.csv"'
    assert table.headers["content-type"].startswith("text/csv")
    assert table.text == to_csv(study.summary())
    with Client(standing.url) as client:
        assert client.repeatability() == told


def test_the_dots_of_corners_and_walls_scatter_as_the_summary_says(standing: Server) -> None:
    for method in found(standing)["methods"]:
        for corner in method["corners"]:
            dots = standing.get(f"/repeatability/corners/{corner['id']}")
            assert dots["id"] == corner["id"]
            xy = np.array(dots["deviations"][method["name"]])
            assert len(xy) == corner["count"]
            np.testing.assert_allclose(xy.mean(0), 0, atol=1e-12)  # m, of sums of metres
            np.testing.assert_allclose(np.cov(xy.T), corner["scatter"])
    for method in found(standing)["walls"]["methods"]:
        assert len(method["walls"]) == 4
        for wall in method["walls"]:
            dots = standing.get(f"/repeatability/walls/{wall['id']}")
            np.testing.assert_allclose(
                np.cov(np.array(dots["deviations"][method["name"]]).T), wall["scatter"]
            )
    assert_problem(standing.http.get("/repeatability/walls/99999"), 404)
    problem = assert_problem(standing.http.get("/repeatability/corners/99999"), 404)
    assert "99999" in problem["detail"]
    assert_problem(standing.http.get(f"/repeatability/corners/{10**30}"), 404)


def test_a_scan_shown_again_is_not_counted_again(standing: Server) -> None:
    for change in ({"view": {"rotate": True}}, {"extraction": {"fitter": "cwlf", "covariance": "published"}}):
        with standing.stream() as stream:
            before = stream.frame()["sequence"]
            standing.change("PATCH", "/settings", change)
            stream.frame(lambda frame, before=before: frame["sequence"] > before)
    assert step(standing, 1, since=12) == as_told(by_hand(standing.folder / "room.npz", range(13)))


@pytest.mark.parametrize("index", [11 + 10, 3, 0])
def test_it_begins_anew_where_a_recording_is_sought(standing: Server, index: int) -> None:
    standing.change("PATCH", "/source", {"index": index})
    scans(standing, 1)
    path = standing.folder / "room.npz"
    wanted = as_told(by_hand(path, range(index, index + 12)))
    told = step(standing, 11, since=1)
    assert positions(told) == positions(wanted)


def positions(told: Json) -> list[Any]:
    """Of all that was found, without the ids, which are never used again."""
    return [
        (method["name"], method["claims"], [corner | {"id": 0} for corner in method["corners"]])
        for method in told["methods"]
    ]


def test_it_begins_anew_with_every_lap(standing: Server) -> None:
    """The last scan, then the first ones: once a lap has come to its end, the window is that of the next one."""
    standing.change("PATCH", "/source", {"index": 58})
    scans(standing, 1)
    standing.change("PATCH", "/source", {"loop": True, "speed": 1, "state": "playing"})
    with standing.stream() as stream:
        stream.frame(lambda frame: frame["source"]["index"] == 59)
        shown = stream.frame(lambda frame: frame["source"]["index"] < 10)["source"]["index"]
    wait_until(lambda: found(standing)["scans"] > 5, "scans of the next lap are in the window")
    counted = found(standing)["scans"]
    index = standing.change("PATCH", "/source", {"state": "paused"})["index"]
    assert shown <= index < 50
    assert counted <= index + 1


def test_it_begins_anew_with_another_source(standing: Server) -> None:
    write_room(standing.folder / "other.npz", scans=20, since=500.0)
    standing.play(standing.folder / "other.npz", paused=True, index=12)
    scans(standing, 1)


@pytest.mark.parametrize("change", [{"min_points": 9}, {"noise": {"sigma_range": 0.03}}])
def test_it_begins_anew_when_scans_are_segmented_otherwise(standing: Server, change: Json) -> None:
    standing.change("PATCH", "/settings", {"extraction": change})
    scans(standing, 1)


def test_the_window_holds_as_many_scans_as_are_wanted(standing: Server) -> None:
    standing.change("PATCH", "/settings", {"repeatability": {"window": 15}})
    scans(standing, 1)
    step(standing, 14, since=1)
    for _ in range(6):
        show(standing, 1)
    newest = scatters(as_told(by_hand(standing.folder / "room.npz", range(11 + 6, 11 + 21))))
    wait_until(lambda: scatters(found(standing)) == newest, "the window has the newest scans")
    assert (found(standing)["window"], found(standing)["scans"]) == (15, 15)
    for window in (9, 1001, 20.5, None):
        response = standing.http.patch("/settings", json={"repeatability": {"window": window, "running": 2}})
        assert_problem(response, 422)


def scatters(told: Json) -> list[Any]:
    return [[corner["mean"] for corner in method["corners"]] for method in told["methods"]]


def test_it_can_be_begun_anew_and_what_was_found_stays_when_it_is_off(standing: Server) -> None:
    before = found(standing)
    standing.change("PATCH", "/settings", {"repeatability": {"running": False}})
    show(standing, 1)
    assert found(standing) == before | {"running": False}
    standing.change("PATCH", "/settings", ON)
    scans(standing, 1)
    step(standing, 2, since=1)
    assert standing.http.delete("/repeatability").status_code == 204
    told = found(standing)
    assert (told["scans"], told["running"]) == (0, True)
    assert "0 scans so far" in told["message"]
    step(standing, 1, since=0)


def test_a_sensor_that_is_pushed_is_said_to_have_moved(server: Server) -> None:
    rng, bearings = np.random.default_rng(1), np.linspace(-np.pi, np.pi, 720, endpoint=False)
    turned = [bearings + (0.0 if i < 15 else 0.4) for i in range(30)]
    ranges = [room_ranges(b) + rng.normal(0, 0.005, len(b)) for b in turned]
    with (server.folder / "pushed.npz").open("wb") as file:
        np.savez(file, ranges=ranges, bearings=bearings, stamps=100 + 0.1 * np.arange(30))
    server.change("PATCH", "/settings", {"repeatability": {"running": True, "window": 100}})
    server.play(server.folder / "pushed.npz", paused=True)
    scans(server, 1)
    step(server, 14, since=1)
    for _ in range(15):
        show(server, 1)
    wait_until(lambda: "The sensor moved" in (found(server)["message"] or ""), "it is said")
    assert found(server)["scans"] < 15


@pytest.mark.long
def test_looking_back_at_a_live_source_neither_counts_twice_nor_begins_anew(watching: Server) -> None:
    frames: list[Frame] = []
    watching.runtime.frame_listeners.append(frames.append)
    watching.change("PATCH", "/settings", ON)
    wait_until(lambda: frames and frames[-1].timed.position.kind == "device", "the sensor is watched")
    watching.http.delete("/repeatability").raise_for_status()
    counts = [0]

    def counted(least: int) -> bool:
        counts.append(found(watching)["scans"])
        return counts[-1] >= least

    wait_until(lambda: counted(12), "some scans are in the window")
    watching.change("PATCH", "/source", {"state": "paused"})
    for by in (-5, 1, 1):
        show(watching, by)
    watching.change("PATCH", "/source", {"state": "playing"})
    wait_until(lambda: counted(counts[0] + 20), "it goes on")
    assert counts == sorted(counts)
    watched = [frame for frame in frames if frame.timed.position.kind == "device"]
    assert counts[-1] <= len({frame.timed.position.index for frame in watched}) < len(watched)


def sought(frame: Frame, seeks: int) -> Frame:
    return replace(frame, timed=replace(frame.timed, seeks=seeks))


@pytest.fixture
def frames(standing: Server) -> list[Frame]:
    """Frames of a server with repeatability on, of one scan after the other."""
    seen: list[Frame] = []
    standing.runtime.frame_listeners.append(seen.append)
    for k in range(6):
        show(standing, 1)
        wait_until(lambda k=k: len(seen) > k)
    standing.runtime.frame_listeners.remove(seen.append)
    return [sought(frame, 0) for frame in seen]


@pytest.fixture
def room() -> LiveRepeatability:
    return LiveRepeatability()


def told(room: LiveRepeatability, frames: list[Frame], count: int) -> None:
    for frame in frames:
        room.observe(frame)
    assert room.summary().scans == count


def test_a_scan_that_cannot_be_worked_on_does_not_end_it(
    room: LiveRepeatability, frames: list[Frame], caplog: pytest.LogCaptureFixture
) -> None:
    def broken(frame: Frame) -> Frame:
        return replace(frame, timed=replace(frame.timed, scan=None))

    told(room, frames[:2], 2)
    told(room, [broken(frames[2]), broken(frames[3]), frames[4]], 3)
    assert caplog.text.count("could not be compared") == 1


def test_scans_left_out_on_the_way_are_no_leap_but_a_seek_is(
    room: LiveRepeatability, frames: list[Frame]
) -> None:
    told(room, [frames[0], frames[1], *frames[3:]], 2 + 3)
    room.clear()
    told(room, [*frames[:2], sought(frames[4], 1), sought(frames[5], 1)], 2)
