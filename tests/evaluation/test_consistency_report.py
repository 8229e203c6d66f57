"""The report of a study: its numbers are the study's, and what is made wrong on purpose is said to be wrong."""

import math
import re
from collections.abc import Callable
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from html_tables import Tables
from lidarcore_app.cli.main import cli
from typer.testing import CliRunner

from lidarcore import FITTERS, SensorNoise
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.evaluation.consistency.figures import SUMS, tally
from lidarcore.evaluation.consistency.report import html
from lidarcore.evaluation.consistency.study import Consistency, Design, Row, study
from lidarcore.evaluation.consistency.trials import Trials
from lidarcore.evaluation.consistency.verdicts import verdict
from lidarcore.evaluation.intervals import Interval

DESIGN = Design(
    rooms=("4.5x2.5", "corridor"),
    noises=(SensorNoise(0.02, 0.001), SensorNoise(0.05, 0.0034)),
    trials=640, blocks=4, beams=360, seed=5,
)  # fmt: skip
COLUMNS = {
    "found": 1, "bias": 1e3, "rms": 1e3, "rms_ratio": 1, "coverage_50": 1, "coverage_95": 1, "coverage_99": 1,
    "anees": 1, "area_ratio": 1,
}  # fmt: skip


@pytest.fixture(scope="module")
def simulated() -> Consistency:
    return study(DESIGN)


def assert_tells(text: str, figure: Interval, factor: float) -> None:
    """'0.951 ±.004' is value and half interval to the digits shown; '< 0.4' the upper end of what may be 0."""
    if text.startswith("< "):
        assert figure.low <= 0
        assert float(text[2:]) == pytest.approx(factor * figure.high, abs=0.5 * 0.1 ** digits(text))
        return
    value, half = text.split(" ±")
    assert float(value) == pytest.approx(factor * figure.value, abs=0.501 * 0.1 ** digits(value))
    assert float(half) == pytest.approx(factor * figure.half_width, abs=0.501 * 0.1 ** digits(half))


def digits(text: str) -> int:
    return len(text.partition(".")[2])


def what(row: Row) -> str:
    noise = f"{100 * row.noise.sigma_range:g} cm, {1000 * row.noise.sigma_bearing:g} mrad"
    return f"Every figure: {noise}; {'all rooms together' if row.room == 'all' else row.room}"


@pytest.mark.long
def test_every_figure_of_every_row_is_in_a_table(simulated: Consistency) -> None:
    report = html(simulated)
    tables = Tables(report).rows
    number = 0
    for row in simulated.rows():
        title = FITTERS[row.fitter].title
        (cells,) = (
            line[3:] for line in tables[what(row)][1:] if line[:3] == [title, row.covariance, row.segments]
        )
        for text, (name, factor) in zip(cells, COLUMNS.items(), strict=True):
            assert_tells(text, row.figures[name], factor)
            number += 1
    assert number == 3 * 2 * 2 * len(FITTERS) * 2 * len(COLUMNS)
    assert not re.search(r"\bnan\b|\binf\b|<(script|link|img|iframe)|https?://|url\(", report, re.IGNORECASE)


def test_bars_are_as_long_as_their_numbers_and_the_nominal_line_is_where_it_should_be(
    simulated: Consistency,
) -> None:
    report = html(simulated)
    rows = [row for row in simulated.pooled() if row.noise == DESIGN.noises[0]]
    for segments, words in (("known", "segments known"), ("found", "real segmentation")):
        for level in (50, 95, 99):
            title = f"in the {level} % ellipse, {words}"
            drawing = report.split(f"<title>{title}</title>")[1].split("</svg>")[0]
            lengths = [float(x) for x in re.findall(r'<rect .*?width="([\d.]+)"', drawing)]
            expected = [row.figures[f"coverage_{level}"].value for row in rows if row.segments == segments]
            left = float(re.search(r'<rect class="\w+" x="([\d.]+)"', drawing)[1])
            nominal = float(re.search(r'class="reference" d="M([\d.]+)', drawing)[1]) - left
            assert np.allclose(np.array(lengths) / nominal, np.array(expected) / (level / 100), atol=0.003)
            shown = re.findall(r'class="value".*?>([^<]+)<', drawing)
            for text, row in zip(shown, [row for row in rows if row.segments == segments], strict=True):
                assert_tells(text, row.figures[f"coverage_{level}"], 1)


def gaussian(spoiled: Callable[[str, str], float], draws: int) -> Consistency:
    """A study of methods that are exact, save for the factor by which they claim too much or too little variance."""
    rng, design = (
        np.random.default_rng(0),
        Design(rooms=("4.5x2.5", "18x9"), noises=(SensorNoise(0.02, 0.001),)),
    )
    truth = np.array([[4e-4, 1e-4], [1e-4, 2e-4]])

    def sums(fitter: str, kind: str) -> np.ndarray:
        errors = rng.multivariate_normal([0, 0], truth, (20, draws), method="cholesky")
        claims = np.broadcast_to(truth * spoiled(fitter, kind), (*errors.shape[:2], 2, 2))
        corners = rng.uniform(1, 4, (20, 2))
        return tally(Trials(errors, claims, np.broadcast_to(truth, (20, 2, 2)), corners))

    shape = (len(design.rooms), 1, design.blocks, 2)
    values = [[sums(fitter, kind) for fitter in FITTERS for kind in KINDS] for _ in range(math.prod(shape))]
    return Consistency(design, np.reshape(values, (*shape, len(FITTERS), len(KINDS), len(SUMS))))


def sentences(report: str) -> dict[str, str]:
    """By segmentation: all that is said of it."""
    summary = unescape(report).split("<h3>")[1].split("</section>")[0]
    return {part.split("</p>")[0]: re.sub(r"<.*?>", " ", part) for part in summary.split("<p>")[1:]}


def test_a_method_that_claims_too_much_or_too_little_is_named_and_no_other() -> None:
    """With a quarter of the variance 52.7 % are inside, by chi-square; with four times of it all but 1 in 1800."""
    wrong = {("cwlf", "published"): 0.25, ("utls", "consistent"): 4.0}
    report = html(gaussian(lambda *method: wrong.get(method, 1.0), 40))
    for text in sentences(report).values():
        small = re.search(r"too small: CWLF published (\d\d\.\d) %\.", text)
        assert float(small[1]) == pytest.approx(100 * (1 - 0.05**0.25), abs=1)
        assert re.search(r"too large: UTLS consistent (99\.9|100\.0) %\.", text)
        assert (
            "Can be believed: Arras-Siegwart (both), CWLF consistent, UTLS published, WTLS (both), WCTLS (both), "
            "Maximum likelihood (both)." in text
        )
        assert "Too few trials" not in text
        assert "not in each" not in text
    for caption in ("segments known", "real segmentation"):
        rows = Tables(report).rows[
            f"Coverage of the 95 % ellipse, %, and whether it can be believed: {caption}"
        ]
        verdicts = {(title, kind): cell.split(" ", 2)[2] for title, kind, cell in rows[1:]}
        assert verdicts.pop(("CWLF", "published")) == "too small"
        assert verdicts.pop(("UTLS", "consistent")) == "too large"
        assert set(verdicts.values()) == {"yes"}


def test_with_few_trials_nothing_is_said_of_good_methods() -> None:
    design_of_few = gaussian(lambda *method: 1.0, 2)
    few = Consistency(Design(**{**vars(design_of_few.design), "blocks": 2}), design_of_few.sums[:, :, :2])
    for text in sentences(html(few)).values():
        assert "Too few trials to tell" in text
        assert "Can be believed" not in text


def test_a_room_that_differs_is_named() -> None:
    good, bad = (gaussian(lambda *method, f=f: f, 40) for f in (1.0, 0.7))
    share = 0.12  # of the trials in the bad room
    mixed = np.stack([good.sums[0], share * bad.sums[1]])
    text = sentences(html(Consistency(good.design, mixed)))["segments known"]
    assert "not in each" in text
    assert "in 18x9" in text
    assert "in 4.5x2.5" not in text


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.94, 0.96, "true"), (0.93, 0.97, "true"), (0.90, 0.929, "too small"), (0.971, 0.99, "too large"),
        (0.92, 0.96, "open"), (0.94, 0.98, "open"), (0.5, 1.0, "open"), (math.nan, math.nan, "open"),
    ],
)  # fmt: skip
def test_the_whole_interval_decides(low: float, high: float, expected: str) -> None:
    assert verdict(Interval((low + high) / 2, low, high)) == expected


def test_where_nothing_is_found_the_report_has_dashes(simulated: Consistency) -> None:
    sums = simulated.sums.copy()
    sums[..., 1:] = 0  # no corner was found
    report = html(Consistency(DESIGN, sums))
    assert not re.search(r"\bnan\b|\binf\b", report, re.IGNORECASE)
    row = Tables(report).rows["Every figure: 2 cm, 1 mrad; all rooms together"][1]
    assert row[4:] == ["–"] * 8


def test_the_command_writes_the_report_of_one_room(tmp_path: Path) -> None:
    output = tmp_path / "study.html"
    arguments = ["evaluate", "consistency", "--room", "4.5x2.5", "--noise", "0.02,0.001", "--trials", "800"]
    result = CliRunner().invoke(cli, [*arguments, "--beams", "360", "--workers", "1", "-o", str(output)])
    assert result.exit_code == 0, result.output
    tables = Tables(output.read_text("utf-8")).rows
    assert len(tables["Every figure: 2 cm, 1 mrad; 4.5x2.5"]) == 1 + 2 * 2 * len(FITTERS)
    assert list(tmp_path.iterdir()) == [output]
