"""A finished map of a recording, from the page: made, localized in with its walls, and saved with the poses."""

import io
from zipfile import ZipFile

from browsing import Visitor
from playwright.sync_api import expect

DEMO = "emulated-s1.mcap"


def test_a_recording_becomes_a_map_that_can_be_localized_in(visitor: Visitor) -> None:
    page, server = visitor.page, visitor.server
    page.get_by_role("tab", name="Source").click()
    page.get_by_role("button", name=f"Make a map of {DEMO}").click()
    expect(page.locator("#making-progress output")).to_contain_text(f"Map of {DEMO}")
    expect(page.locator("#making-progress")).to_be_in_viewport()
    expect(page.locator("#made")).to_contain_text(f"of {DEMO}, made in", timeout=240_000)
    expect(page.locator("#making-progress")).to_be_hidden()
    session = server.get("map/making")["making"]["session"]
    with page.expect_download() as saved:
        page.get_by_role("link", name="Save all files, with the poses").click()
    assert saved.value.suggested_filename == f"map-{session}.zip"
    with ZipFile(io.BytesIO(saved.value.path().read_bytes())) as archive:
        poses = archive.read("poses.csv").decode().splitlines()
    assert len(poses) == 1 + server.get(f"recordings/{DEMO}/facts")["scans"]

    page.get_by_role("button", name="Localize in it").click()
    page.get_by_role("tab", name="Map").click()
    expect(page.get_by_role("radio", name="Localize")).to_be_checked()
    kept = {f"W{wall['id']}" for wall in server.get(f"walls?session={session}")["walls"]}
    expect(page.locator("#mapped-table tbody tr")).to_have_count(len(kept))
    assert {row.split()[0] for row in page.locator("#mapped-table tbody tr").all_inner_texts()} == kept
    row = page.locator("#map-list li", has_text=f"Map {session}")
    expect(row).to_contain_text(f"{len(kept)} walls")
    server.patch("settings", {"navigation": None})
    server.api.delete(f"sessions/{session}").raise_for_status()


def test_a_map_that_takes_too_long_is_cancelled(visitor: Visitor) -> None:
    page = visitor.page
    page.get_by_role("tab", name="Source").click()
    page.get_by_role("button", name=f"Make a map of {DEMO}").click()
    page.locator("#making-progress").get_by_role("button", name="Cancel").click()
    expect(page.locator("#making-progress")).to_be_hidden()
    assert visitor.server.get("map/making")["making"]["state"] == "cancelled"
