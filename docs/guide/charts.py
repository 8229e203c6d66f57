"""The guide's figures of bars."""

from collections.abc import Callable, Sequence

from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.intervals import LEVEL, Interval
from lidarcore.lines import FITTERS
from lidarcore.reporting import Bar, bars
from lidarcore.settings import Covariance

from .measurement import Figures, Measurement
from .pictures import STYLES

_LEAST = 0.1  # where logarithmic bars begin
_SCATTER = "m2"
Rows = list[Bar | str]


def coverage(m: Measurement) -> str:
    """How often the ellipses hold the truth."""
    rows = _both(m, "coverage_95", lambda x: f"{100 * x:.1f} %")
    return bars(rows, 1.0, title="Coverage of the 95 % ellipses by method", mark=LEVEL)


def anees(m: Measurement) -> str:
    """The average normalised squared error."""
    rows = _both(m, "anees", lambda x: f"{x:.2f}")
    return bars(rows, _most(rows), title="ANEES by method, logarithmic", least=_LEAST, mark=1.0)


def areas(m: Measurement) -> str:
    """Areas claimed and filled, over that of the bound."""
    claimed = _rows(
        "claimed as published", _of(m, "published", "claimed_area"), "{:.2f}".format, STYLES["published"]
    )
    filled = _rows("filled by the errors", _of(m, "published", "actual_area"), "{:.2f}".format, _SCATTER)
    rows = claimed + filled
    return bars(
        rows, _most(rows), title="Areas over that of the bound by method, logarithmic", least=_LEAST, mark=1.0
    )


def bias(m: Measurement) -> str:
    """How far off methods are on average, at the least and at the largest noise of the table."""
    rows: Rows = []
    for noise in (m.design.table.noises[0], m.design.table.noises[-1]):
        figures = {name: m.by_noise[noise, "known", name, "consistent"]["bias"] for name in FITTERS}
        heading = f"mean error, range noise {100 * noise.sigma_range:g} cm"
        rows += _rows(heading, figures, lambda x: f"{1e3 * x:.1f} mm", STYLES["consistent"])
    return bars(rows, _most(rows), title="Bias by method")


def _both(m: Measurement, figure: str, text: Callable[[float], str]) -> Rows:
    return [row for kind in KINDS for row in _rows(kind, _of(m, kind, figure), text, STYLES[kind])]


def _of(m: Measurement, kind: Covariance, figure: str) -> Figures:
    return {name: m.by_method["papers", name, kind][figure] for name in FITTERS}


def _rows(heading: str, figures: dict[str, Interval], text: Callable[[float], str], style: str) -> Rows:
    return [
        heading,
        *(Bar(name, x.value, x.low, x.high, text(x.value), style) for name, x in figures.items()),
    ]


def _most(rows: Sequence[Bar | str]) -> float:
    return max(row.high for row in rows if isinstance(row, Bar))
