"""Which landmarks a scan should have shown, against a room of known walls."""

import numpy as np
import pytest

from lidarcore import Scan
from lidarcore.localization.visibility import Visibility
from lidarcore.scan import Array
from lidarcore.simulation import World

BEARINGS = np.linspace(-np.pi, np.pi, 720, endpoint=False)
# A room of 8 x 8 m around the sensor, with a screen to its left.
WALLS = World(
    np.array(
        [
            [[4, -4], [4, 4]], [[4, 4], [-4, 4]], [[-4, 4], [-4, -4]], [[-4, -4], [4, -4]], [[-1, 2], [1, 2]],
        ],
        float,
    )
)  # fmt: skip
RANGES, _ = WALLS.cast(np.zeros(3), BEARINGS)

IN_SIGHT = np.array([[4.0, 4], [-4, -4], [4, -4], [4, 0], [-1, 2], [0, -4]])
HIDDEN = np.array([[0.0, 4], [0.5, 3.5], [0, 6]])
IN_THE_OPEN = np.array([[2.0, 0], [-1.5, -2], [0, -3.2]])


def costs(points: Array, ranges: Array = RANGES, bearings: Array = BEARINGS) -> tuple[list[bool], list[bool]]:
    seen = Visibility(Scan(ranges, bearings))(points)
    return (seen.unseen > 0).tolist(), (seen.absent > 0).tolist()


def test_what_nothing_hides_should_be_seen() -> None:
    assert costs(IN_SIGHT) == ([True] * len(IN_SIGHT), [False] * len(IN_SIGHT))


def test_what_is_behind_a_wall_is_not_missed() -> None:
    assert costs(HIDDEN) == ([False] * len(HIDDEN), [False] * len(HIDDEN))


def test_what_the_scan_looks_through_is_not_there() -> None:
    assert costs(IN_THE_OPEN) == ([True] * len(IN_THE_OPEN), [True] * len(IN_THE_OPEN))


@pytest.mark.parametrize("points", [IN_SIGHT, IN_THE_OPEN])
def test_where_nothing_returned_nothing_is_missed(points: Array) -> None:
    assert costs(points, np.full(len(BEARINGS), np.nan))[0] == [False] * len(points)


def test_outside_the_field_of_view_nothing_is_missed() -> None:
    ahead = np.abs(BEARINGS) < 1.0
    points = np.array([[4.0, 0], [4, 4], [0, -4], [-4, -4]])
    assert costs(points, RANGES[ahead], BEARINGS[ahead])[0] == [True, True, False, False]


def test_someone_in_front_of_a_corner_hides_it_and_half_of_it() -> None:
    """Legs at 2 m in the direction of the corner, and beside it where one of its walls should be."""
    for aside in (0.0, 0.04):
        ranges = np.where(np.abs(BEARINGS - np.pi / 4 - aside) < 0.03, 2.0, RANGES)
        assert costs(np.array([[4.0, 4]]), ranges)[0] == [False]


def test_it_does_not_matter_where_the_ring_starts() -> None:
    points = np.concatenate([IN_SIGHT, HIDDEN, IN_THE_OPEN])
    for shift in (1, 180, 400):
        assert costs(points, np.roll(RANGES, shift), np.roll(BEARINGS, shift)) == costs(points)
