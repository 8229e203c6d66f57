"""How fast the page is: `python docs/page_speed.py` prints what `docs/explanation/figures.md` says of it.

It starts a server of its own, with the simulated robot that builds a map, and looks at it with two headless Chromiums,
the inspector open. Without a graphics card Chromium draws the scene in software, in a process of its own: its time is
not counted as the page's. The yardstick is an empty page, which gets the same frames beside them and draws nothing.
"""

import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import psutil
from lidarcore_app.benchmarks.server_load import SETTLE, server
from playwright.sync_api import Browser, CDPSession, Page, sync_playwright

CHROMIUM = "/usr/bin/chromium-headless-shell"
FLAGS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
VISITS = 5
SECONDS = 20.0
SAMPLING = 200  # µs
OURS = ("/static/js/", "/static/viser_bridge.js")
# When the first frame was drawn, ms since the page was asked for; then how old each was when it was sent and drawn.
WATCH = """
  const first = () => {
    const isThere = document.querySelector("#readout-frame")?.textContent > 0;
    requestAnimationFrame(isThere ? (now) => (window.firstDrawn = now) : first);
  };
  requestAnimationFrame(first);
  window.ages = [];
  window.WebSocket = class extends WebSocket {
    constructor(...of) {
      super(...of);
      if (!`${of[0]}`.includes("/api/v1/stream")) return;
      this.addEventListener("message", ({ data }) => {
        const message = JSON.parse(data);
        const received = performance.now();
        const sent = message.timings?.age_ms;
        const age = () => window.ages.push([sent, sent + performance.now() - received]);
        if (message.type === "frame") requestAnimationFrame(() => requestAnimationFrame(age));
      });
    }
  };
"""
Json = dict[str, Any]


def main() -> None:
    """Measure and print all."""
    print(f"load average {psutil.getloadavg()[0]:.1f} on {psutil.cpu_count()} cores before")
    with sync_playwright() as playwright, server() as (process, port), _browsers(playwright) as browsers:
        url = f"http://127.0.0.1:{port}"
        _visit(browsers[0], url)  # the kernels are compiled
        first = [_visit(browsers[0], url).evaluate("window.firstDrawn") for _ in range(VISITS)]
        print(f"goto to the first frame drawn: {_spread(first)} ms of {VISITS} visits")
        for method in ("landmarks", "scans"):
            _build_map(url, method)
            print(f"SLAM by {method}, inspector open:")
            for count in (1, 2):
                _measure(url, browsers[:count], process)


@contextmanager
def _browsers(playwright: Any) -> Iterator[list[Browser]]:
    found = [playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS) for _ in range(2)]
    try:
        yield found
    finally:
        for browser in found:
            browser.close()


def _visit(browser: Browser, url: str) -> Page:
    """A page that has drawn a frame, with nothing remembered; the one before is closed."""
    for context in browser.contexts:
        context.close()
    page = browser.new_context(viewport={"width": 1400, "height": 900}).new_page()
    page.add_init_script(f"localStorage.setItem('welcomed', 'yes'); if (window === top) {{ {WATCH} }}")
    page.goto(url)
    page.wait_for_function("() => window.firstDrawn")
    return page


def _build_map(url: str, method: str) -> None:
    with httpx.Client(base_url=f"{url}/api/v1", timeout=60) as api:
        robot = {"kind": "simulation", "settings": {"world": "two rooms"}}
        api.put("/source", json=robot).raise_for_status()
        api.patch("/settings", json={"navigation": {"mode": "slam", "method": method}}).raise_for_status()


def _measure(url: str, browsers: list[Browser], process: psutil.Process) -> None:
    pages = [_visit(browser, url) for browser in browsers]
    for page in pages:
        page.locator("#tab-map").click()
        page.locator("#corner-table tbody button").first.dispatch_event("click")
    empty = _empty_page(browsers[0], url)
    pages[0].wait_for_timeout(1e3 * SETTLE)
    drawing = [child for child in psutil.Process().children(recursive=True) if _draws(child)]
    spent, start = [_seconds([process]), _seconds(drawing)], time.monotonic()
    *watched, yardstick = _watched([*pages, empty])
    now, passed = [_seconds([process]), _seconds(drawing)], time.monotonic() - start
    server_load, drawing_load = (100 * (b - a) / passed for a, b in zip(spent, now, strict=True))
    print(
        f"  {len(pages)} browsers: server {server_load:.0f} % of a core, drawing in software {drawing_load:.0f} %",
        end="",
    )
    print(f", load average {psutil.getloadavg()[0]:.1f}")
    for ages, name in [*((ages, "") for ages in watched), (yardstick, "yardstick, an empty page: ")]:
        sent, drawn = (_spread(list(part)) for part in zip(*ages, strict=True))
        print(
            f"    {name}{len(ages) / SECONDS:.1f} frames a second, when sent {sent} ms old, when drawn {drawn}"
        )
    # Profiled once the ages are known: it takes time that frames would wait for.
    sessions = [page.context.new_cdp_session(page) for page in pages]
    for session in sessions:
        _begin(session)
    for session, ages in zip(sessions, _watched(pages), strict=True):
        _tell(session, len(ages))
    for page in (*pages, empty):
        page.context.close()


def _empty_page(browser: Browser, url: str) -> Page:
    """A page without anything that gets the frames."""
    page = browser.new_context().new_page()
    page.add_init_script(WATCH)
    page.goto(f"{url}/api/v1/version")
    page.evaluate("new WebSocket(`${location.origin.replace('http', 'ws')}/api/v1/stream`)")
    return page


def _draws(process: psutil.Process) -> bool:
    try:
        return "--type=gpu-process" in process.cmdline()
    except psutil.Error:  # it has ended
        return False


def _seconds(processes: list[psutil.Process]) -> float:
    return sum(sum(process.cpu_times()[:2]) for process in processes)


def _watched(pages: list[Page]) -> list[list[list[float]]]:
    """How old each frame of some seconds was when it was sent and drawn, ms, for each page."""
    for page in pages:
        page.evaluate("window.ages = []")
    pages[0].wait_for_timeout(1e3 * SECONDS)
    return [page.evaluate("window.ages") for page in pages]


def _begin(session: CDPSession) -> None:
    session.send("Performance.enable")
    session.send("Profiler.enable")
    session.send("Profiler.setSamplingInterval", {"interval": SAMPLING})
    session.send("Profiler.start")


def _tell(session: CDPSession, frames: int) -> None:
    script, costs = _own_work(session.send("Profiler.stop")["profile"])
    print(f"    own work: {script / 1e3 / frames:.1f} ms of script a frame, of which")
    for name, spent in sorted(costs.items(), key=lambda cost: -cost[1])[:8]:
        print(f"      {spent / 1e3 / frames:.2f} ms {name}")


def _own_work(profile: Json) -> tuple[float, dict[str, float]]:
    """Time, µs, in our functions and what they call; and by the innermost of ours."""
    nodes = {node["id"]: node for node in profile["nodes"]}
    parent = {child: node["id"] for node in profile["nodes"] for child in node.get("children", ())}
    ours: dict[int, str | None] = {}

    def innermost(id_: int) -> str | None:
        if id_ not in ours:
            frame = nodes[id_]["callFrame"]
            place = f"{frame['functionName'] or 'anonymous'} {frame['url'].rsplit('/static/', 1)[-1]}"
            is_ours = any(part in frame["url"] for part in OURS)
            ours[id_] = f"{place}:{frame['lineNumber'] + 1}" if is_ours else None
            if not is_ours and id_ in parent:
                ours[id_] = innermost(parent[id_])
        return ours[id_]

    costs: dict[str, float] = {}
    for id_, spent in zip(profile["samples"], profile["timeDeltas"], strict=True):
        if name := innermost(id_):
            costs[name] = costs.get(name, 0.0) + spent
    return sum(costs.values()), costs


def _spread(values: list[float]) -> str:
    return f"{statistics.median(values):.0f} (median), {max(values):.0f} (most)"


if __name__ == "__main__":
    main()
