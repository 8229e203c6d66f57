"""The page of studies: chosen, run, watched, cancelled, read and deleted by a real user on a real server."""

import re
from collections.abc import Callable, Iterator

import pytest
from browsing import Visitor
from playwright.sync_api import Locator, Page, expect
from test_accessibility import CONTROLS, SMALL_TARGETS, TEXT_COLOURS, contrast
from waiting import wait_until

LONG = 120_000  # ms for what starts a process

Visit = Callable[..., Visitor]


@pytest.fixture
def studies(visit: Visit) -> Iterator[Callable[..., Visitor]]:
    """Makes a visitor of the page; nothing runs and no report is left in the end."""
    visitors: list[Visitor] = []

    def make(*size: int, **options: bool | str) -> Visitor:
        visitor = visit(*size, **options)
        visitor.page.goto(f"{visitor.server.url}/studies")
        expect(visitor.page.locator("#kinds .study")).to_have_count(4)
        visitors.append(visitor)
        return visitor

    yield make
    api = visitors[0].server.api
    api.delete("studies/running")
    wait_until(lambda: (api.get("studies").json()["run"] or {}).get("state") != "running", "nothing runs")
    for report in api.get("studies").json()["reports"]:
        api.delete(f"studies/reports/{report['name']}").raise_for_status()


def study(page: Page, title: str) -> Locator:
    return page.get_by_role("region", name=title)


def run_short(visitor: Visitor) -> None:
    """The study of consistency, as small as can be, with the noise set now."""
    form = study(visitor.page, "Which ellipses can be believed?")
    form.get_by_text("Options").click()
    form.get_by_label("Trials").fill("1000")
    form.get_by_text("As set now").click()
    form.get_by_role("button", name="Run").click()


@pytest.mark.long
def test_a_study_is_run_and_its_report_read_in_the_page(studies: Callable[..., Visitor]) -> None:
    visitor = studies(1400, 900)
    page = visitor.page
    visitor.server.patch("settings", {"extraction": {"noise": {"sigma_range": 0.013}}})
    page.reload()
    expect(page.locator("#study-consistency .noise-now")).to_have_text("13.0 mm, 0.195°")
    run_short(visitor)
    expect(page.locator("#run-state")).to_have_text("Running")
    expect(page.locator("#run-figures")).to_have_text(
        re.compile(r"^\d+ of 120 parts, \d+\s*s so far"), timeout=LONG
    )
    for button in page.get_by_role("button", name="Run").all():
        expect(button).to_be_disabled()
    expect(page.locator("#run-state")).to_have_text(re.compile("^Finished after"), timeout=LONG)
    shown = page.frame_locator("#report")
    expect(shown.get_by_role("heading", name="Which ellipses can be believed?")).to_be_visible()
    expect(shown.get_by_role("heading", name="Noise 1.3 cm, 3.4 mrad").first).to_be_attached()
    name = visitor.server.get("studies")["reports"][0]["name"]
    assert page.url.endswith(f"#report={name}")
    expect(page.locator("#report-list")).to_contain_text("quick, 1,000 trials, noise 13.0 mm, 0.195°, seed 0")
    with page.expect_download() as download:
        page.get_by_role("link", name="Download").click()
    assert download.value.suggested_filename == f"{name}.html"
    page.reload()
    expect(page.frame_locator("#report").get_by_role("heading", name="How this was made")).to_be_attached()
    page.goto(f"{visitor.server.url}/studies")  # where none is chosen, the newest is shown
    expect(page.locator("#viewer-title")).to_have_text("Which ellipses can be believed?")
    page.set_viewport_size({"width": 390, "height": 844})
    expect(page.locator("#viewer")).to_be_hidden()
    page.set_viewport_size({"width": 1400, "height": 900})
    expect(page.frame_locator("#report").get_by_role("heading", name="How this was made")).to_be_attached()
    page.get_by_role("button", name=f"Delete {name}").click()
    expect(page.locator("#toasts")).to_contain_text(
        f"“Which ellipses can be believed?” ({name}) will be deleted from the server."
    )
    page.keyboard.press("Escape")
    expect(page.locator(".toast")).to_have_count(0)
    delete = page.get_by_role("button", name=f"Delete {name}")
    expect(delete).to_be_focused()
    delete.click()
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(page.get_by_text("None yet: run a study.")).to_be_visible()
    expect(page.locator("#viewer")).to_be_hidden()
    page.get_by_role("link", name="Dashboard").click()
    expect(page.locator("#readout-frame")).to_have_text(re.compile(r"^\d+$"), timeout=30_000)


@pytest.mark.long
def test_a_study_is_cancelled(studies: Callable[..., Visitor]) -> None:
    visitor = studies()
    form = study(visitor.page, "Conditional weighted linear fitting")
    form.get_by_text("Full").click()
    form.get_by_role("button", name="Run").click()
    visitor.page.get_by_role("button", name="Cancel").click(timeout=LONG)
    expect(visitor.page.locator("#run-state")).to_have_text(re.compile("^Cancelled after"))
    expect(form.get_by_role("button", name="Run")).to_be_enabled()
    assert visitor.server.get("studies")["run"]["state"] == "cancelled"


@pytest.mark.long
def test_what_went_wrong_is_said_in_the_words_of_the_command(studies: Callable[..., Visitor]) -> None:
    """The demo's people walk about, but its sensor stands still, and a lidar of that name it has not."""
    visitor = studies()
    form = study(visitor.page, "Weighted conformal total least squares")
    form.get_by_text("Options").click()
    expect(form.get_by_label("Topic")).to_be_hidden()
    form.get_by_label("Recording").select_option("emulated-s1.mcap")
    form.get_by_label("Topic").fill("/none")
    form.get_by_role("button", name="Run").click()
    expect(visitor.page.locator("#run-state")).to_have_text(re.compile("^Failed after .*/none"), timeout=LONG)


def test_a_recording_is_told_the_noise_set_now_and_the_rooms_the_papers(
    studies: Callable[..., Visitor],
) -> None:
    form = study(studies().page, "Conditional weighted linear fitting")
    form.get_by_text("Options").click()
    usual, now = (form.get_by_role("radio", name=re.compile(name)) for name in ("^Usual", "^As set now"))
    expect(usual).to_be_checked()
    form.get_by_label("Recording").select_option("emulated-s1.mcap")
    expect(now).to_be_checked()
    form.get_by_text("Usual").click()
    form.get_by_label("Scans").fill("20")
    expect(usual).to_be_checked()  # what was chosen by hand stays
    form.get_by_label("Recording").select_option("")
    expect(usual).to_be_checked()


@pytest.mark.long
def test_the_main_table_of_a_report_fits_beside_the_studies(
    studies: Callable[..., Visitor],
) -> None:
    """With four noises, one beside the other: nothing is cut off."""
    visitor = studies(1400, 900)
    visitor.server.api.post("studies/consistency", json={"trials": 1000}).raise_for_status()
    table = visitor.page.frame_locator("#report").locator("table").first
    expect(table.get_by_role("columnheader")).to_have_count(6, timeout=LONG)
    assert table.evaluate("node => node.parentNode.scrollWidth <= node.parentNode.clientWidth")


def test_the_keyboard_alone_starts_and_cancels(studies: Callable[..., Visitor]) -> None:
    page = studies().page
    page.get_by_role("radio", name=re.compile("^Quick")).first.focus()
    page.keyboard.press("ArrowRight")
    expect(page.get_by_role("radio", name=re.compile("^Full")).first).to_be_checked()
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    cancel = page.get_by_role("button", name="Cancel")
    expect(cancel).to_be_visible(timeout=LONG)
    cancel.focus()
    page.keyboard.press("Enter")
    expect(page.locator("#run-state")).to_have_text(re.compile("^Cancelled"))


@pytest.mark.long
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_page_and_its_report_are_as_light_or_dark_as_the_dashboard(
    studies: Callable[..., Visitor], theme: str
) -> None:
    visitor = studies(390, 844, theme="dark", has_touch=True, is_mobile=True)
    visitor.server.patch("settings", {"view": {"theme": theme}})
    page = visitor.page
    page.reload()
    expect(page.locator("html")).to_have_attribute("data-theme", theme)
    run_short(visitor)
    heading = page.frame_locator("#report").get_by_role("heading", name="Which ellipses can be believed?")
    expect(heading).to_be_visible(timeout=LONG)
    page.wait_for_timeout(200)  # colours fade in for 120 ms
    ground = heading.evaluate("node => getComputedStyle(node.ownerDocument.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", ground)[:3])) > 384) == (theme == "light")
    weak = [text for text, a, b in page.evaluate(TEXT_COLOURS) if contrast(a, b) < 4.5]
    assert weak == []
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert page.evaluate(SMALL_TARGETS) == []


def test_every_control_of_the_page_has_a_name(studies: Callable[..., Visitor]) -> None:
    page = studies().page
    for options in page.get_by_text("Options").all():
        options.click()
    nodes = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
    found = [(n["role"]["value"], n.get("name", {}).get("value", "")) for n in nodes if not n["ignored"]]
    controls = [(role, name) for role, name in found if role in CONTROLS]
    assert len(controls) > 30
    assert [role for role, name in controls if not name.strip()] == []


@pytest.mark.long
@pytest.mark.parametrize("size", [(390, 844), (768, 1024), (1000, 640), (1400, 900)])
def test_the_head_of_the_dashboard_has_room_for_its_links(visit: Visit, size: tuple[int, int]) -> None:
    page = visit(*size).open().page
    bar = page.locator("header.bar")
    assert bar.evaluate("node => node.scrollWidth <= node.clientWidth")
    assert page.evaluate("document.documentElement.scrollWidth") == size[0]
    tops = set()
    for name in ("Guide", "Studies", "API"):
        box = bar.get_by_role("link", name=name).bounding_box()
        assert 0 <= box["x"] <= size[0] - box["width"]
        tops.add(box["y"])
    assert len(tops) == 1
    assert tops == {page.get_by_role("button", name="Light or dark").bounding_box()["y"]}
    assert page.locator(".tabs").evaluate("node => node.scrollWidth <= node.clientWidth")
    bar.get_by_role("link", name="Studies").click()
    expect(page.get_by_role("heading", name="Studies")).to_be_visible()
