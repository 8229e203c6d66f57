"""Another source begins anew: its room is looked at, and its charts hold nothing of the one before."""

import numpy as np
from browsing import Visitor, wait_until

CHARTED = "import('/static/js/history.js').then(({ columns }) => columns([])[0].length)"
TARGET = "Object.values(scene.contentWindow.__viserMutable.cameraControl.getTarget())"
FOLLOWED_MS = 3000  # the scene looks every second whether the room is still in the view


def test_another_source_is_fitted_in_the_view_and_charted_anew(visitor: Visitor) -> None:
    page, server = visitor.page, visitor.server
    page.wait_for_timeout(FOLLOWED_MS)
    page.mouse.move(200, 200)
    page.mouse.down()
    page.mouse.move(320, 320, steps=3)
    page.mouse.up()
    page.wait_for_timeout(FOLLOWED_MS)
    dragged, count = page.evaluate(TARGET), page.evaluate(CHARTED)
    page.wait_for_timeout(FOLLOWED_MS)
    assert page.evaluate(TARGET) == dragged, "it stays where it was dragged"
    assert page.evaluate(CHARTED) > count
    choice = {"kind": "simulation", "settings": {"world": "corridor"}}
    server.api.put("source", json=choice).raise_for_status()
    wait_until(lambda: np.abs(np.subtract(page.evaluate(TARGET), dragged)).max() > 0.5, "it is fitted")
    assert page.evaluate(CHARTED) < count
