"""Whether the filter has diverged: the pose is vague, or scans contradict it."""

from lidarcore.geometry import largest_variance
from lidarcore.localization.ekf.estimate import Estimate
from lidarcore.localization.tracking_result import State

_FAR_OFF = 1.0  # m, a standard deviation of the position beyond which gates let anything through
_TURNED = 0.5  # rad, the same of the heading
_PATIENCE = 10  # scans in a row that contradict the pose before it is given up


class DivergenceCheck:
    """Judges the pose by its covariance, and by whether scans show what they should."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget earlier contradictions: the pose was set."""
        self._at_odds = 0

    def judge(self, estimate: Estimate, is_at_odds: bool) -> State:
        """State after a scan that showed what it should have, or was at odds with the map."""
        self._at_odds = self._at_odds + 1 if is_at_odds else 0
        if _is_vague(estimate) or self._at_odds >= _PATIENCE:
            return "lost"
        return "coasting" if estimate.coasting else "tracking"


def _is_vague(estimate: Estimate) -> bool:
    """True if the pose is too uncertain to tell landmarks apart."""
    P = estimate.covariance
    return bool(largest_variance(P[:2, :2]) > _FAR_OFF**2 or P[2, 2] > _TURNED**2)
