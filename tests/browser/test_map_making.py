"""A finished map of a recording, from the page: made, localized in with its walls, and saved with the poses."""

import io
import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from zipfile import ZipFile

import psutil
import pytest
from browsing import ROOT, Server, Visitor
from playwright.sync_api import expect
from waiting import wait_until

DEMO, WINDSOR, COPY = "emulated-s1.mcap", "real-rplidar-windsor.npz", "copy.npz"
CORNER = {"x": 1, "y": 2, "var_x": 1e-4, "cov_xy": 0, "var_y": 1e-4, "kind": "corner"}
MAP = {"format": "lidarcore landmarks", "version": 1, "unit": "m", "landmarks": [CORNER]}


def test_a_recording_becomes_a_map_that_can_be_localized_in(visitor: Visitor) -> None:
    page, server = visitor.page, visitor.server
    page.get_by_role("tab", name="Source").click()
    page.get_by_role("button", name=f"Make a map of {DEMO}").click()
    expect(page.locator("#making-progress output")).to_contain_text(f"Map of {DEMO}")
    expect(page.locator("#making-progress")).to_be_in_viewport()
    expect(page.locator("#made")).to_contain_text(f"of {DEMO}, made in", timeout=240_000)
    expect(page.locator("#making-progress")).to_be_hidden()
    expect(page.locator("#made")).to_contain_text("keeps the files of the last eight until it ends")
    session = server.get("map/making")["making"]["session"]
    expect(page.locator(".toast")).to_contain_text(f"emulated-s1 (map {session}) is finished")
    server.patch(f"sessions/{session}", {"name": "Hall"})
    expect(page.locator("#made")).to_contain_text(f"Hall (map {session}) of {DEMO}, made in")
    server.patch(f"sessions/{session}", {"name": "emulated-s1"})
    with page.expect_download() as saved:
        page.get_by_role(
            "link", name=f"Save all files, with the poses, of emulated-s1 (map {session})"
        ).click()
    assert saved.value.suggested_filename == "emulated-s1-with-poses.zip"
    with ZipFile(io.BytesIO(saved.value.path().read_bytes())) as archive:
        poses = archive.read("poses.csv").decode().splitlines()
    assert len(poses) == 1 + server.get(f"recordings/{DEMO}/facts")["scans"]

    page.get_by_role("button", name="Localize in it").click()
    expect(page.locator(".toast")).to_have_count(0)  # no message names it any more
    server.patch(f"sessions/{session}", {"name": "Lobby"})
    expect(page.locator("#made")).to_contain_text(f"Lobby (map {session}) of {DEMO}, made in")
    server.patch(f"sessions/{session}", {"name": "emulated-s1"})
    page.get_by_role("tab", name="Map").click()
    expect(page.get_by_role("radio", name="Localize")).to_be_checked()
    kept = {f"W{wall['id']}" for wall in server.get(f"walls?session={session}")["walls"]}
    expect(page.locator("#mapped-table tbody tr")).to_have_count(len(kept))
    assert {row.split()[0] for row in page.locator("#mapped-table tbody tr").all_inner_texts()} == kept
    row = page.locator("#map-list li", has_text=f"Map {session}")
    expect(row).to_contain_text(f"{len(kept)} walls")
    expect(row.locator(".entry span")).to_have_text("emulated-s1")
    expect(page.get_by_role("button", name="Clear")).to_be_disabled()  # it has no landmarks
    measure_as_rest_does(visitor, session)
    server.patch("settings", {"navigation": None})
    server.api.delete(f"sessions/{session}").raise_for_status()


def measure_as_rest_does(visitor: Visitor, session: int) -> None:
    """From a corner of the map that is localized in to a wall elsewhere; cards of its own walls are linked."""
    page = visitor.page
    visitor.server.patch("source", {"state": "paused"})  # else the view may move between place and click
    visitor.fit()
    told = visitor.knows("mapped")
    corner = next(one for one in told["corners"] if len(one["walls"]) > 1)
    ids = {wall["id"] for wall in told["walls"]}
    assert {id for one in told["corners"] for id in one["walls"]} <= ids
    away = [wall for wall in told["walls"] if wall["id"] not in corner["walls"]]
    wall = max(away, key=lambda one: one["length"])
    (u, v), (x, y) = corner["at"], [0.6 * a + 0.4 * b for a, b in zip(*wall["ends"], strict=True)]
    page.keyboard.press("d")
    for place in ((u, v), (x, y)):
        page.mouse.click(*visitor.pixel_at([*place]))
        page.wait_for_timeout(200)
    asked = f"measure?first=map-corner@{u:.4f},{v:.4f}&second=map-wall:{wall['id']}"
    found = visitor.server.get(asked)
    assert found == visitor.server.get(f"{asked}&session={session}")
    said = f"^{found['distance']:.3f}.m ± {1e3 * found['sigma']:.1f}.mm$"
    expect(page.locator("#measure-text")).to_have_text(re.compile(said))
    page.keyboard.press("d")
    one, other = corner["walls"][:2]
    page.get_by_role("button", name=f"W{one}", exact=True).click()
    card = page.get_by_role("complementary", name="Inspector")
    card.get_by_role("button", name=f"Wall W{other},").click()
    expect(card.get_by_role("heading", name=f"Wall W{other} of the map")).to_be_visible()
    page.keyboard.press("Escape")


@pytest.mark.parametrize(("width", "theme"), [(1400, "light"), (390, "dark")])
def test_a_map_is_named_by_the_keyboard_and_nameless_again(
    visit: Callable[..., Visitor], server: Server, width: int, theme: str
) -> None:
    id = server.api.post("map", json=MAP).raise_for_status().json()["id"]
    visitor = visit(width, 844, theme=theme).open()
    visitor.tolerated.append("422")  # of a name that is refused
    page = visitor.page
    page.get_by_role("tab", name="Map").click()
    row = page.locator("#map-list li").first

    def rename(before: str, name: str) -> None:
        row.get_by_role("button", name=f"Rename {before}", exact=True).press("Enter")
        field = page.get_by_label(f"New name of {before}", exact=True)
        expect(field).to_be_focused()
        field.fill(name)
        field.press("Enter")

    long = "Hall, ground floor, " * 8
    for before, name, after in (
        (f"map {id}", "  hall ", f"hall (map {id})"),
        (f"hall (map {id})", long, f"{long.strip()} (map {id})"),
    ):
        rename(before, name)
        shown = page.get_by_title(f"Localize in {after}", exact=True)
        expect(shown).to_be_focused()
        expect(shown).to_contain_text(name.strip())
        expect(row.locator(".about")).to_contain_text(f"Map {id}, a file")
        expect(row.get_by_role("button", name=f"Delete {after}")).to_be_in_viewport()
        assert server.get("sessions")["sessions"][-1]["name"] == name.strip()
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    row.get_by_role("button", name=f"Rename {after}").click()
    field = page.get_by_label(f"New name of {after}")
    field.fill("\u202eanother")
    field.press("Enter")
    expect(page.locator(".toast")).to_contain_text("The map was not renamed")
    expect(field).to_have_value("\u202eanother")  # what was typed can be mended
    page.keyboard.press("Escape")
    expect(row).to_contain_text(long.strip())
    rename(after, " ")
    expect(row.locator(".entry span")).to_have_text(f"Map {id}")
    assert server.get("sessions")["sessions"][-1]["name"] == ""
    server.api.delete(f"sessions/{id}").raise_for_status()


def test_the_list_of_maps_follows_what_others_do(visitor: Visitor) -> None:
    page, api = visitor.page, visitor.server.api
    page.get_by_role("tab", name="Map").click()
    rows = page.locator("#map-list li")
    expect(page.locator("#map-list")).not_to_be_empty()
    before = rows.count()
    id = api.post("map", json=MAP).raise_for_status().json()["id"]
    expect(rows).to_have_count(before + 1)
    api.patch(f"sessions/{id}", json={"name": "Hall of others"}).raise_for_status()
    expect(rows.first).to_contain_text("Hall of others")
    asked = sum("/sessions" in url for url in visitor.asked)
    page.get_by_role("tab", name="Source").click()
    api.delete(f"sessions/{id}").raise_for_status()
    revision = visitor.knows("sessionsRevision")
    visitor.server.patch("settings", {"view": {"theme": "light"}})
    visitor.catch_up()
    assert visitor.knows("sessionsRevision") >= revision
    assert sum("/sessions" in url for url in visitor.asked) == asked  # nobody sees the list
    page.get_by_role("tab", name="Map").click()
    expect(rows).to_have_count(before)


def test_a_question_takes_the_place_of_the_one_before(visit: Callable[..., Visitor], server: Server) -> None:
    """Else who taps twice on one answer gives the next one, too."""
    page = visit(390, 844).open().page
    ids = [server.api.post("map", json=MAP).raise_for_status().json()["id"] for _ in range(2)]
    page.get_by_role("tab", name="Map").click()
    for id in ids:
        page.get_by_role("button", name=f"Delete map {id}", exact=True).click()
    expect(page.locator(".toast")).to_have_count(1)
    expect(page.locator(".toast")).to_contain_text(f"Delete map {ids[1]}?")
    page.locator(".toast").get_by_role("button", name="Delete").dblclick()
    expect(page.get_by_role("button", name=f"Delete map {ids[1]}", exact=True)).to_have_count(0)
    assert [one["id"] for one in server.get("sessions")["sessions"]][-1] == ids[0]
    server.api.delete(f"sessions/{ids[0]}").raise_for_status()


def test_who_deletes_maps_by_the_keyboard_goes_on_with_the_next_one(visitor: Visitor) -> None:
    page, server = visitor.page, visitor.server
    for one in server.get("sessions")["sessions"]:
        server.api.delete(f"sessions/{one['id']}").raise_for_status()
    first, second, third = (server.api.post("map", json=MAP).raise_for_status().json()["id"] for _ in "123")
    page.get_by_role("tab", name="Map").click()
    maps = page.get_by_role("region", name="Maps")
    for id, focused in (
        (second, maps.get_by_title(f"Localize in map {first}")),
        (first, maps.get_by_title(f"Localize in map {third}")),
        (third, maps.get_by_role("heading", name="Maps")),
    ):
        page.get_by_role("button", name=f"Delete map {id}", exact=True).press("Enter")
        page.get_by_role("button", name="Delete", exact=True).press("Enter")
        expect(page.get_by_title(f"Localize in map {id}")).to_have_count(0)
        expect(focused).to_be_focused()


def test_a_name_that_is_being_typed_stays_when_another_map_comes(visitor: Visitor) -> None:
    page, server = visitor.page, visitor.server
    id = server.api.post("map", json=MAP).raise_for_status().json()["id"]
    page.get_by_role("tab", name="Map").click()
    page.get_by_role("button", name=f"Rename map {id}", exact=True).click()
    field = page.get_by_label(f"New name of map {id}", exact=True)
    field.fill("hal")
    file = {"name": "another.json", "mimeType": "application/json", "buffer": json.dumps(MAP).encode()}
    page.locator("#map-file").set_input_files(file)
    expect(page.locator(".toast")).to_contain_text("another.json")
    wait_until(lambda: visitor.knows("maps")["sessions"][-1]["id"] == id + 1, "the page knows of it")
    expect(field).to_be_focused()
    field.press("l")
    field.press("Enter")
    expect(page.get_by_title(f"Localize in hall (map {id})")).to_be_visible()
    expect(page.get_by_title(f"Localize in map {id + 1}")).to_be_visible()
    for one in (id, id + 1):
        server.api.delete(f"sessions/{one}").raise_for_status()


@contextmanager
def held(recording: str) -> Iterator[None]:
    """The process that makes a map of a recording stands still meanwhile, so that it cannot be finished."""

    def makers() -> list[psutil.Process]:
        commands = [(one, one.cmdline()) for one in psutil.Process().children(recursive=True)]
        return [
            one for one, parts in commands if "map" in parts and any(p.endswith(recording) for p in parts)
        ]

    wait_until(makers, "its process runs")
    (process,) = makers()
    process.suspend()
    try:
        yield
    finally:
        process.resume()


def test_a_second_map_waits_for_the_first_one_and_can_be_given_up(visitor: Visitor) -> None:
    page, server = visitor.page, visitor.server
    (server.folder / COPY).write_bytes((ROOT / "app" / "demo" / WINDSOR).read_bytes())
    page.get_by_role("tab", name="Source").click()
    queue = page.locator("#making-queue li")
    page.get_by_role("button", name=f"Make a map of {DEMO}").click()
    expect(page.locator("#making-progress output")).to_contain_text(f"Map of {DEMO}")
    with held(DEMO):
        for number, recording in enumerate((WINDSOR, COPY), 1):
            page.get_by_role("button", name=f"Make a map of {recording}").click()
            expect(queue).to_have_count(number)
        expect(queue).to_have_text([f"Map of {WINDSOR}: waiting", f"Map of {COPY}: waiting"])
        expect(queue.last).to_be_in_viewport()
        page.get_by_role("button", name=f"Do not make the map of {WINDSOR}").press("Enter")
        expect(queue).to_have_text([f"Map of {COPY}: waiting"])
        expect(page.get_by_role("button", name=f"Do not make the map of {COPY}")).to_be_focused()
    page.locator("#making-progress").get_by_role("button", name="Cancel").click()
    expect(page.locator("#making-progress output")).to_contain_text(f"Map of {COPY}")
    expect(queue).to_have_count(0)
    page.locator("#making-progress").get_by_role("button", name="Cancel").click()
    expect(page.locator("#making-progress")).to_be_hidden()
    ended = [(one["recording"], one["state"]) for one in server.get("map/making")["ended"]]
    assert ended[-3:] == [(WINDSOR, "cancelled"), (DEMO, "cancelled"), (COPY, "cancelled")]


def test_a_map_that_takes_too_long_is_cancelled(visitor: Visitor) -> None:
    page = visitor.page
    page.get_by_role("tab", name="Source").click()
    page.get_by_role("button", name=f"Make a map of {DEMO}").click()
    page.locator("#making-progress").get_by_role("button", name="Cancel").press("Enter")
    expect(page.locator("#making-progress")).to_be_hidden()
    assert visitor.server.get("map/making")["making"]["state"] == "cancelled"
    expect(page.get_by_role("button", name=f"Make a map of {DEMO}")).to_be_focused()


def test_a_map_that_others_let_be_made_is_followed_and_can_be_cancelled(visitor: Visitor) -> None:
    """While a recording stands still the stream tells of nothing else, and when none is made nobody asks for one."""
    page, server = visitor.page, visitor.server
    server.show(ROOT / "app" / "demo" / WINDSOR, 0)
    visitor.catch_up()
    page.get_by_role("tab", name="Source").click()
    progress = page.locator("#making-progress")
    expect(progress).to_be_hidden()
    server.api.post("map/making", json={"recording": DEMO}).raise_for_status()
    expect(progress.locator("output")).to_have_text(re.compile(rf"Map of {DEMO}: [1-9]\d* of \d+ scans"))
    server.api.post("map/making", json={"recording": WINDSOR}).raise_for_status()
    expect(page.locator("#making-queue li")).to_have_text([f"Map of {WINDSOR}: waiting"])
    server.api.delete("map/making").raise_for_status()
    expect(progress.locator("output")).to_contain_text(f"Map of {WINDSOR}")
    progress.get_by_role("button", name="Cancel").click()
    expect(progress).to_be_hidden()
    server.emulate()
    wait_until(lambda: server.get("map/making")["making"]["state"] == "cancelled", "it has ended")
    page.wait_for_timeout(1000)
    asked = sum("map/making" in url for url in visitor.asked)
    page.wait_for_timeout(2000)
    assert sum("map/making" in url for url in visitor.asked) == asked


def test_files_that_the_server_no_longer_keeps_are_told_of(
    visit: Callable[..., Visitor], tmp_path: Path
) -> None:
    """It started anew while the page stood still, which had seen it otherwise."""
    own = Server(tmp_path)
    own.start()
    visitor = visit(at=own)
    visitor.tolerated += ["net::ERR_", "WebSocket", "Failed to fetch"]
    page = visitor.page
    try:
        page.clock.install()
        visitor.open()
        page.get_by_role("tab", name="Source").click()
        page.get_by_role("button", name=f"Make a map of {DEMO}").click()
        link = page.get_by_role("link", name="Save all files, with the poses")
        expect(link).to_be_visible()
        page.clock.pause_at(page.evaluate("Date.now() + 1000"))
        own.kill()
        link.click()
        expect(page.locator(".toast")).to_contain_text("No answer from the server")
        own.start()
        link.click()
        gone = page.locator(".toast", has_text="These files are gone")
        expect(gone).to_contain_text(f"Make the map of {DEMO} once more")
        assert page.url.startswith(own.url)
    finally:
        own.kill()


def test_nothing_is_asked_or_offered_about_a_map_that_others_deleted(visitor: Visitor) -> None:
    """Messages with a button, also where no list of maps is seen; questions; and the form of its name."""
    page, api = visitor.page, visitor.server.api
    toasts = page.locator(".toast")
    stays = api.post("map", json=MAP).raise_for_status().json()["id"]

    def loaded() -> int:
        before = api.get("sessions").json()["sessions"][-1]["id"]
        file = {"name": "hall.json", "mimeType": "application/json", "buffer": json.dumps(MAP).encode()}
        page.locator("#map-file").set_input_files(file)
        expect(page.get_by_role("button", name="Localize in it")).to_be_visible()
        id = api.get("sessions").json()["sessions"][-1]["id"]
        assert id > before
        return id

    page.get_by_role("tab", name="Map").click()
    offered = loaded()
    page.get_by_role("tab", name="Source").click()
    api.delete(f"sessions/{offered}").raise_for_status()
    expect(toasts).to_have_count(0)

    page.get_by_role("tab", name="Map").click()
    questioned = loaded()
    page.get_by_role("button", name=f"Delete map {questioned}", exact=True).click()
    expect(toasts).to_have_count(2)
    api.delete(f"sessions/{questioned}").raise_for_status()
    expect(toasts).to_have_count(0)

    renamed = loaded()
    page.get_by_role("button", name=f"Rename map {renamed}", exact=True).click()
    page.get_by_label(f"New name of map {renamed}", exact=True).fill("Hall")
    api.delete(f"sessions/{renamed}").raise_for_status()
    expect(page.get_by_label(f"New name of map {renamed}", exact=True)).to_have_count(0)
    expect(toasts).to_have_count(1)
    expect(toasts).to_contain_text(f"Map {renamed} is gone")
    expect(page.get_by_title(f"Localize in map {stays}")).to_be_focused()
    api.delete(f"sessions/{stays}").raise_for_status()


def test_who_localized_in_a_map_that_is_deleted_is_told_to_choose_another_one(visitor: Visitor) -> None:
    page, server = visitor.page, visitor.server
    stays, goes = (server.api.post("map", json=MAP).raise_for_status().json()["id"] for _ in "12")
    page.get_by_role("tab", name="Map").click()
    page.get_by_title(f"Localize in map {goes}").click()
    wait_until(lambda: server.get("localization")["session"] == goes, "it is localized in")
    server.patch("source", {"state": "paused"})
    page.get_by_role("button", name=f"Delete map {goes}", exact=True).click()
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(page.locator("#pose-panel-state")).to_contain_text("choose another map")
    expect(page.locator("#landmark-note")).to_have_text(
        "No map is localized in. Choose one in Maps, or switch to SLAM to build one."
    )
    page.locator("#navigation .segments label", has_text="Off").click()
    wait_until(lambda: server.get("localization")["map"] is None, "it is chosen no longer")
    with page.expect_response(lambda answer: f"landmarks?session={stays}&" in answer.url):
        page.locator("#navigation .segments label", has_text="Localize").click()
    wait_until(lambda: server.get("localization")["session"] == stays, "the newest is localized in")
    for one in server.get("sessions")["sessions"]:
        server.api.delete(f"sessions/{one['id']}").raise_for_status()
    expect(page.locator("#landmark-note")).to_have_text("There is no map. Switch to SLAM to build one.")
