"""Another source begins anew: its room is looked at, and its charts hold nothing of the one before."""

import numpy as np
import pytest
from browsing import Visitor
from playwright.sync_api import Page
from waiting import wait_until

HISTORY = "import('/static/js/history.js')"
CAMERA = "scene.contentWindow.__viserMutable?.cameraControl"
TARGET = f"Object.values({CAMERA}.getTarget())"
FOLLOWED_MS = 3000  # the scene looks every second whether the room is still in the view


def charted(page: Page) -> list[int | None]:
    """Of each frame in the charts, 1 if it is of a simulation."""
    column = "({ columns }) => columns([({ kind }) => kind === 'simulation' && 1])[1]"
    found: list[int | None] = page.evaluate(f"{HISTORY}.then({column})")
    return found


def resting(page: Page) -> list[float]:
    """What the camera looks at once it has not moved for a while."""
    targets: list[list[float]] = []

    def rests() -> bool:
        page.wait_for_timeout(FOLLOWED_MS)
        targets.append(page.evaluate(TARGET))
        return targets[-1] in targets[-2:-1]

    wait_until(rests, "the camera rests")
    return targets[-1]


@pytest.mark.long
@pytest.mark.scene
def test_another_source_is_fitted_in_the_view_and_charted_anew(visitor: Visitor) -> None:
    page, server = visitor.page, visitor.server
    wait_until(lambda: page.evaluate(f"Boolean({CAMERA})"), "the scene has begun")
    fitted = resting(page)
    page.mouse.move(200, 200)
    page.mouse.down()
    page.mouse.move(320, 320, steps=3)
    page.mouse.up()
    dragged, count = resting(page), len(charted(page))
    assert np.abs(np.subtract(dragged, fitted)).max() > 0.5, "it stays where it was dragged"
    wait_until(lambda: len(charted(page)) > count, "frames are charted")
    choice = {"kind": "simulation", "settings": {"world": "corridor"}}
    server.api.put("source", json=choice).raise_for_status()
    wait_until(lambda: np.abs(np.subtract(page.evaluate(TARGET), dragged)).max() > 0.5, "it is fitted")
    assert set(charted(page)) == {1}
