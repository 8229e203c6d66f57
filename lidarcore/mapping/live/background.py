"""What works behind the front end, on keyframes, while scans go on."""

from dataclasses import dataclass
from typing import Literal, Protocol

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose
from lidarcore.localization.tracking_result import State
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.tracked import Tracked
from lidarcore.mapping.walls import Walls

END_WITHIN = 5.0  # s that a thread may take for what it is at


@dataclass(frozen=True, slots=True, eq=False)
class Corrected:
    """Poses (K, 3), T_map_keyframe, of the first K keyframes, and the covariance (3, 3) of the last of them."""

    poses: Array
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False)
class MapPicture:
    """What is known of the building: which cells are occupied and free, and the walls, none before the first search."""

    grid: OccupancyGrid
    walls: Walls | None = None


class Background(Protocol):
    """Makes a map of keyframes, or finds them in one; `corrected` and `picture` may be read from any thread."""

    mode: Literal["slam", "localize"]

    @property
    def corrected(self) -> Corrected:
        """Where the keyframes lie as far as that is known; replaced whole."""

    @property
    def picture(self) -> MapPicture | None:
        """The building as it is known now; replaced whole."""

    @property
    def is_behind(self) -> bool:
        """Whether keyframes wait."""

    def put(self, tracked: Tracked) -> None:
        """Go on by a keyframe."""

    def place(self, T_map_keyframe: UncertainPose) -> None:
        """Go on from a pose of the last keyframe that someone has told. Raises LocalizationError."""

    def judge(self, tracked: Tracked, here: UncertainPose) -> tuple[State, str | None]:
        """Whether the pose of a scan is to be believed, and what is to be said about that."""

    def end(self) -> None:
        """Take no more; returns at once."""

    def close(self) -> None:
        """End, and wait for it."""
