"""Numbers in the text: each carries its value and interval, so that a test can measure it again.

A number passes through plain text, escaped like any other, between marks; `marked_up` makes elements of them.
"""

import re
from dataclasses import dataclass

import numpy as np

from lidarcore.evaluation.consistency.figures import HONEST
from lidarcore.evaluation.intervals import Interval

_BEGIN, _THEN, _END, _QUOTE = (
    "\ue000",
    "\ue001",
    "\ue002",
    "\ue003",
)  # of no script: they are in no other text
_NUMBER = re.compile(f"{_BEGIN}(.*?){_THEN}(.*?){_END}")
_SPEC = re.compile("(?P<rough>~?)(?P<digits>[0-9]?)(?P<unit>[a-z%°]*)(?P<bare>!?)")
_FACTORS = {"": 1.0, "%": 100.0, "m": 1.0, "cm": 100.0, "mm": 1e3, "mrad": 1e3, "°": 180 / np.pi}


@dataclass(frozen=True, slots=True)
class Told:
    """A number as the text tells it: one that came out with its interval, or one that is so (float).

    Format: digits after the point and a unit, as in `{:1mm}` or `{:0%}`; `~` leaves the interval away, `!` the unit.
    """

    of: Interval | float

    def __format__(self, spec: str) -> str:
        """Marked text. Raises ValueError for a format that there is not."""
        match = _SPEC.fullmatch(spec)
        if match is None or match["unit"] not in _FACTORS:
            raise ValueError(f"{spec!r} is no format of a number of the guide.")
        factor, unit = _FACTORS[match["unit"]], "" if match["bare"] else match["unit"]
        text = self._text(match["digits"], factor, bool(match["rough"]))
        return _marked(_attributes(self.of), text + ("" if unit in ("", "°") else "\u00a0") + unit)

    def _text(self, digits: str, factor: float, rough: bool) -> str:
        if isinstance(self.of, Interval) and not rough:
            return self.of.text(int(digits or 0), factor).replace(" ± ", "\u00a0±\u00a0")
        value = factor * (self.of.value if isinstance(self.of, Interval) else self.of)
        return f"{value:,.{digits}f}" if digits else f"{value:,.10g}"


def judged(coverage: Interval) -> str:
    """A coverage for a table, %, in the colour of its worth."""
    colour = "--good" if coverage.value >= HONEST[0] else "--bad"
    return _marked(f'{_attributes(coverage)} style="color: var({colour})"', coverage.text(1, 100))


def marked_up(html: str) -> str:
    """The page with an element for every number, for `code` and for *words* that are explained."""
    html = re.sub("`([^`]+)`", r"<code>\1</code>", html)
    html = re.sub(r"(?<=[ >(])\*([^*<>]+)\*", r"<em>\1</em>", html)
    return _NUMBER.sub(r"<data \1>\2</data>", html).replace(_QUOTE, '"')


def _attributes(of: Interval | float) -> str:
    if isinstance(of, float):
        return f'value="{of:.6g}"'
    return f'value="{of.value:.6g}" data-low="{of.low:.6g}" data-high="{of.high:.6g}"'


def _marked(attributes: str, text: str) -> str:
    return f"{_BEGIN}{attributes}{_THEN}{text}{_END}".replace('"', _QUOTE)  # which would be escaped
