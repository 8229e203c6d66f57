"""Names that a file can have on every system."""

import re

from ..errors import InvalidNameError

# A file name on every system, and what to do about another one.
PLAIN_NAME = re.compile(r"(?!\.)[^/\\:*?\"<>|\x00-\x1f\x7f\ud800-\udfff]{1,200}(?<![. ])")
PLAINLY = (
    'leave out / \\ : * ? " < > | and control characters, a dot in front and a dot or blank at the end; '
    "200 bytes at most"
)


def checked_name(name: str) -> str:
    """The name, if it is a plain file name. Raises InvalidNameError otherwise."""
    if not is_plain(name):
        raise InvalidNameError(f"{name!r} is not a plain file name: {PLAINLY}.")
    return name


def is_plain(name: str) -> bool:
    """Whether it is one; 200 bytes, too, since some systems count these."""
    return bool(PLAIN_NAME.fullmatch(name)) and len(name.encode()) <= 200
