"""Settings made in the page are the server's settings, and change the frames."""

import json
import math

import numpy as np
import pytest
from browsing import HOKUYO, Visitor, drawn
from playwright.sync_api import expect
from waiting import wait_until

from lidarcore import ExtractionSettings

pytestmark = pytest.mark.real_data

METHODS = ("arras_siegwart", "cwlf", "utls", "wtls", "wctls", "ml")


@pytest.mark.long
def test_fitter_chosen_in_the_page_makes_the_frames(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    for name in ("cwlf", "utls"):
        page.get_by_label("Fitter").select_option(name)
        wait_until(lambda name=name: server.get("frame")["fitter"] == name, f"{name} makes the frames")
        assert server.get("settings")["extraction"]["fitter"] == name
        expect(page.locator("#corner-table thead")).to_contain_text(name)


@pytest.mark.long
def test_covariance_kind_changes_the_ellipses(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    server.show(HOKUYO, 120)
    page.get_by_label("Fitter").select_option("cwlf")
    wait_until(lambda: server.get("frame")["fitter"] == "cwlf", "cwlf makes the frames")
    consistent = server.get("frame")["corners"]
    page.get_by_text("Published", exact=True).click()
    wait_until(lambda: server.get("frame")["covariance"] == "published", "the frame is made again")
    published = server.get("frame")["corners"]
    assert [corner["id"] for corner in published] == [corner["id"] for corner in consistent] != []
    areas = np.array([[c["by_method"]["cwlf"]["area"] for c in found] for found in (published, consistent)])
    assert (areas[0] < areas[1]).all(), "cwlf's formula claims less than any unbiased method can know"
    expect(page.locator("#legend")).to_contain_text("published")


@pytest.mark.long
def test_comparison_fills_the_table_for_every_method(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    server.show(HOKUYO, 120)
    page.get_by_role("switch", name="Compare methods").click()
    wait_until(lambda: set(server.get("frame")["methods"]) == set(METHODS), "all methods are in the frame")
    frame = visitor.await_frame(server.get("frame"))
    rows = page.locator("#corner-table tbody tr").all_inner_texts()
    assert len(rows) == len(frame["corners"]) > 0
    for row, corner in zip(rows, sorted(frame["corners"], key=lambda c: c["id"]), strict=True):
        name, *cells = row.replace("\u2212", "-").split()
        assert name == f"C{corner['id']}"
        assert len(cells) == 3 + 3 * len(METHODS)
        assert set(corner["by_method"]) == set(METHODS)
        x, y, *claims, angle = map(float, cells)
        first = corner["by_method"][frame["methods"][0]]
        assert (x, y) == pytest.approx((first["x"], first["y"]), abs=5.1e-4)
        assert angle == pytest.approx(math.degrees(first["angle"]), abs=0.06)
        for method, at in zip(frame["methods"], range(0, len(claims), 3), strict=True):
            measured = corner["by_method"][method]
            sigma_x, sigma_y, area = claims[at : at + 3]
            assert sigma_x == pytest.approx(1e3 * measured["sigma_x"], abs=0.51)
            assert sigma_y == pytest.approx(1e3 * measured["sigma_y"], abs=0.51)
            assert area == pytest.approx(1e6 * measured["area"], abs=0.51)


@pytest.mark.long
def test_comparison_without_an_answer_says_how_to_get_it(visitor: Visitor) -> None:
    server, table = visitor.server, visitor.page.locator("#corner-table")
    server.api.delete("repeatability").raise_for_status()
    server.patch("settings", {"view": {"compare": True}})
    expect(table).to_contain_text("Which ellipses are true?")
    expect(table.get_by_text("inside 95")).to_be_hidden()
    table.get_by_role("button", name="Compare with the next scans").click()
    wait_until(lambda: server.get("settings")["repeatability"]["running"], "scans are compared")
    expect(table.get_by_text("inside 95")).to_be_visible()
    expect(table.get_by_text("Which ellipses are true?")).to_be_hidden()


@pytest.mark.long
def test_method_taken_out_of_the_comparison_leaves_the_frames(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    server.patch("settings", {"view": {"compare": True}})
    page.locator("#compared input[data-method=wtls]").uncheck()
    wait_until(lambda: "wtls" not in server.get("frame")["methods"], "wtls is gone")
    expect(page.locator("#corner-table thead")).not_to_contain_text("wtls")
    assert server.get("settings")["view"]["methods"] == [name for name in METHODS if name != "wtls"]


@pytest.mark.long
def test_noise_is_entered_in_millimetres_and_degrees(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    page.get_by_role("spinbutton", name="Range in mm", exact=True).fill("35")
    page.get_by_role("spinbutton", name="Bearing in °").fill("0.5")
    page.keyboard.press("Enter")
    wait_until(lambda: server.get("settings")["extraction"]["noise"]["sigma_bearing"] > 0.008, "both are set")
    noise = server.get("settings")["extraction"]["noise"]
    assert noise["sigma_range"] == pytest.approx(0.035)
    assert noise["sigma_bearing"] == pytest.approx(math.radians(0.5))


@pytest.mark.long
def test_every_parameter_has_its_unit_and_goes_back_to_its_default(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    defaults = server.get("settings")["extraction"]
    numbers = [name for name, value in defaults.items() if type(value) in (int, float)]
    page.locator("#segmentation").get_by_text("For experts").click()
    for name in numbers:
        control = page.locator(f"#setting-extraction-{name}")
        control.fill(f"{2 * float(control.input_value()):g}")
        page.keyboard.press("Enter")
    changed = {name: pytest.approx(2 * defaults[name], rel=0.01) for name in numbers}
    wait_until(lambda: server.get("settings")["extraction"] == defaults | changed, "all are changed")
    page.get_by_role("button", name="Reset to defaults").click()
    wait_until(lambda: server.get("settings")["extraction"] == defaults, "all are back")
    units = page.locator("#segmentation .unit").all_inner_texts()
    assert len(units) == len(numbers)
    assert set(units) == {"mm", "m", "°", ""}


@pytest.mark.long
def test_slider_keeps_its_place_while_dragged(visitor: Visitor) -> None:
    """Others change settings meanwhile, and the echo of every step comes back: neither moves the slider."""
    server, page = visitor.server, visitor.page
    slider = page.get_by_role("slider", name="Corner gap")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 2, middle)
    page.mouse.down()
    for part in (0.6, 0.7, 0.8):
        page.mouse.move(box["x"] + box["width"] * part, middle)
        server.patch("settings", {"view": {"colour": "range"}})
    held = float(slider.input_value())
    wanted = visitor.knows("settings")["extraction"]["corner_gap"]
    assert wanted > 1.2 * ExtractionSettings().corner_gap
    wait_until(
        lambda: server.get("settings")["extraction"]["corner_gap"] == wanted, "the last step has arrived"
    )
    server.patch("settings", {"extraction": {"corner_gap": 0.07}})
    expect(page.get_by_role("spinbutton", name="Corner gap")).to_have_value("0.07")
    assert float(slider.input_value()) == held > 250
    page.mouse.up()


@pytest.mark.long
def test_value_out_of_range_is_not_sent(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    before = server.get("settings")
    sent: list[str | None] = []
    page.on("request", lambda request: request.method == "PATCH" and sent.append(request.post_data))
    number = page.get_by_role("spinbutton", name="Min points")
    number.fill("0")
    page.keyboard.press("Enter")
    assert number.evaluate("node => node.validity.rangeUnderflow")
    assert server.get("settings") == before
    number.fill("9")
    with page.expect_response(lambda response: response.request.method == "PATCH"):
        page.keyboard.press("Enter")
    assert [json.loads(body) for body in sent] == [{"extraction": {"min_points": 9}}]
    assert server.get("settings")["extraction"]["min_points"] == 9


@pytest.mark.long
@pytest.mark.scene
def test_layers_can_be_hidden(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    server.show(HOKUYO, 60)
    visitor.fit()
    for layer in ("points", "segments", "ellipses", "grid"):
        before = drawn(visitor.still_picture()).sum()
        page.locator(
            "#view label.chip", has_text={"segments": "Walls"}.get(layer, layer.capitalize())
        ).click()
        wait_until(
            lambda layer=layer: not visitor.knows("settings")["view"]["layers"][layer], f"{layer} are off"
        )
        wait_until(lambda before=before: drawn(visitor.picture()).sum() < before, "less is drawn")


@pytest.mark.long
def test_rejections_say_why_a_wall_is_missing(visitor: Visitor) -> None:
    server, page = visitor.server, visitor.page
    server.show(HOKUYO, 60)
    before = server.get("frame")
    server.patch("settings", {"extraction": {"min_length": 2.5}})
    page.get_by_role("tab", name="Rejected").click()
    wait_until(lambda: server.get("frame")["sequence"] > before["sequence"], "the frame is made again")
    expected = [rejection["message"] for rejection in server.get("frame")["rejections"]]
    assert len(expected) > len(before["rejections"]), "walls of this room are shorter than 2.5 m"
    expect(page.locator("#rejection-count")).to_have_text(str(len(expected)))
    for message in expected[:5]:
        expect(page.locator("#rejection-list")).to_contain_text(message)
