"""What is said about a scan besides the state."""

from lidarcore.errors import LocalizationError
from lidarcore.localization.whereabouts import State

NO_ODOMETRY = "Odometry is missing: the pose is predicted at constant velocity."
NEW_MAP = "There are too few landmarks to keep the pose: a new map is begun."
OF_STATE: dict[State, str] = {
    "coasting": "No landmark is recognised: the pose is only predicted.",
    "lost": "The pose is not to be trusted any more: it is looked for in the map.",
}


def left_out(error: LocalizationError) -> str:
    """Why a scan is not used."""
    return f"{_fact(error)}: the scan was left out."


def goes_on(error: LocalizationError) -> str:
    """What broke, and is over."""
    return f"{_fact(error)}: it goes on from the new values."


def _fact(error: LocalizationError) -> str:
    """What was found, without what a caller of the filter could do about it."""
    return str(error).partition(":")[0]
