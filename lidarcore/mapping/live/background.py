"""What works behind the front end, on keyframes, while scans go on."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from lidarcore.arrays import Array
from lidarcore.geometry import UncertainPose
from lidarcore.localization.tracking_result import State
from lidarcore.mapping.grid import OccupancyGrid
from lidarcore.mapping.live.worker import Worker
from lidarcore.mapping.tracked import Tracked
from lidarcore.mapping.walls import WallTable
from lidarcore.settings import ExtractionSettings

END_WITHIN = 5.0  # s that a thread may take for what it is at


@dataclass(frozen=True, slots=True, eq=False)
class Corrected:
    """Where keyframes lie, T_map_keyframe.

    keyframes   number of those whose poses are known, the first ones of all
    poses       (K, 3) of the newest of them
    covariance  (3, 3) of the last pose
    """

    keyframes: int
    poses: Array
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False)
class MapPicture:
    """What is known of the building: which cells are occupied and free, and the walls, none before the first search.

    Those of a map that is made now are `Walls`, of which it is known how they err together.
    """

    grid: OccupancyGrid
    walls: WallTable | None = None


class Background(ABC):
    """Makes a map of keyframes, or finds them in one, mostly in a thread of its own.

    corrected  where the keyframes lie as far as that is known
    picture    the building as it is known now

    Both are replaced whole, and may be read from any thread.
    """

    mode: ClassVar[Literal["slam", "localize"]]
    corrected: Corrected
    picture: MapPicture | None
    _worker: Worker[Any] | None

    @property
    def is_behind(self) -> bool:
        """Whether keyframes wait."""
        return self._worker is not None and self._worker.is_behind

    def put(self, item: Tracked | UncertainPose | ExtractionSettings) -> None:
        """Go on by a keyframe, or by what was told; returns at once, or, without a thread, raises what goes wrong."""
        if self._worker is None:
            self._step(item, 0)
        else:
            self._worker.put(item)

    @abstractmethod
    def place(self, T_map_keyframe: UncertainPose) -> None:
        """Go on from a pose of the last keyframe that someone has told. Raises LocalizationError."""

    @abstractmethod
    def renew(self, extraction: ExtractionSettings) -> None:
        """Find walls so from here on; returns at once."""

    @abstractmethod
    def judge(self, tracked: Tracked, here: UncertainPose) -> tuple[State, str | None]:
        """Whether the pose of a scan is to be believed, and what is to be said about that."""

    @abstractmethod
    def _step(self, item: Any, waiting: int) -> None:
        """Do what an item asks for; so many wait behind it."""

    def end(self) -> None:
        """Take no more; returns at once."""
        if self._worker is not None:
            self._worker.end()

    def close(self) -> None:
        """End, and wait for it."""
        if self._worker is not None:
            self._worker.close(END_WITHIN)
