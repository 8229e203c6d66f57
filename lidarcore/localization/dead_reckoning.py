"""What odometry alone says: where the sensor would be, and how it moves."""

from lidarcore.arrays import Array
from lidarcore.geometry import compose, relative
from lidarcore.localization.ekf.estimate import Instant
from lidarcore.scan import Scan

_LONG = 1.0  # s, over which an increment does not tell the velocity at its end
Velocity = tuple[float, float, float]  # m/s ahead, rad/s, m/s to the left


class DeadReckoning:
    """Adds up the increments of odometry from a pose on: `pose` (3,), or None while there is no odometry."""

    def __init__(self) -> None:
        self.pose: Array | None = None
        self._last: Instant | None = None

    def place(self, pose: Array) -> None:
        """Go on from another pose (3,)."""
        if self.pose is not None:
            self.pose = pose

    def interrupt(self) -> None:
        """The next odometry has nothing to do with the last: the increment between them is not known."""
        self._last = None

    def carry(self, now: Instant, start: Array) -> None:
        """Add the way to this instant; at the first that has odometry the sensor is at the start (3,)."""
        if now.odometry is None:
            return
        if self.pose is None:
            self.pose = start
        elif self._last is not None and self._last.odometry is not None:
            self.pose = compose(self.pose, relative(self._last.odometry, now.odometry))
        self._last = now

    def velocity(self, scan: Scan) -> Velocity | None:
        """How the sensor has moved since the last instant, if that can be told."""
        if self._last is None or self._last.odometry is None or scan.odometry is None:
            return None
        dt = scan.stamp - self._last.stamp
        if not 0 < dt <= _LONG:
            return None
        x, y, turn = (relative(self._last.odometry, scan.odometry) / dt).tolist()
        return x, turn, y
