"""Charts of reports, by what is drawn."""

import re

import pytest

from lidarcore.reporting.charts import Bar, bars


def test_bars_end_where_their_axis_does() -> None:
    values = (0.0, 1.0, 2.0, 3.0)
    drawing = bars([Bar("", value, value, value, "", "plain") for value in values], 2.0, title="")
    nothing, half, whole, beyond = (
        float(width) for width in re.findall(r'<rect .*?width="([\d.]+)"', drawing)
    )
    assert nothing == 0
    assert whole == pytest.approx(2 * half, abs=0.2)
    assert beyond == whole > 0
