"""The guide as it is shipped: made by this code, of numbers that come out again, its pictures showing what is said."""

import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from docs.guide.measurement import GuideDesign, Measurement, measure
from docs.guide.page import SOURCES, html
from docs.guide.text import WORDS, sections
from docs.guide.values import values

SHIPPED = Path(__file__).parents[2] / "static" / "guide.html"
CITATION = r"\[(?:(?:CWLF|WCTLS|EKF)(?: [\d-]+,?)*(?:, )?)+\]"
NUMBER = re.compile(r"<data ([^>]*)>(.*?)</data>")
SIGMAS = 5  # of the difference of two measurements: 400 numbers are compared


@pytest.fixture(scope="module")
def shipped() -> str:
    return SHIPPED.read_text("utf-8")


@pytest.fixture(scope="module")
def fresh() -> Measurement:
    """Measured anew, from other scans and fewer."""
    return measure(replace(GuideDesign(), seed=1).quick())


@pytest.fixture(scope="module")
def remade(fresh: Measurement) -> str:
    """The page of that, which says it were made like the one shipped."""
    return html(replace(fresh, design=GuideDesign()))


def without(page: str, *patterns: str) -> str:
    for pattern in patterns:
        page = re.sub(pattern, "", page, flags=re.DOTALL)
    return page


def attributes(number: str) -> dict[str, float]:
    return {name: float(value) for name, value in re.findall(r'([\w-]+)="(-?[\d.e+-]+|nan|-?inf)"', number)}


def numbers(page: str) -> list[tuple[dict[str, float], str]]:
    return [(attributes(given), text) for given, text in NUMBER.findall(page)]


@pytest.mark.long
def test_the_shipped_page_is_what_this_code_makes_but_for_numbers_and_drawings(
    shipped: str, remade: str
) -> None:
    chance = ("<style>.*?</style>", "<svg.*?</svg>", NUMBER.pattern)
    assert without(shipped, *chance) == without(remade, *chance), "make guide"


@pytest.mark.long
def test_every_number_comes_out_again(shipped: str, remade: str) -> None:
    pairs = list(zip(numbers(shipped), numbers(remade), strict=True))
    assert len(pairs) > 150
    for (said, text), (again, _) in pairs:
        if "data-low" not in said:
            assert said == again, text
            continue
        errors = [(of["data-high"] - of["data-low"]) / 2 / 1.96 for of in (said, again)]
        assert abs(said["value"] - again["value"]) <= SIGMAS * np.hypot(*errors), (text, again)


def test_the_text_of_a_number_is_its_value(shipped: str) -> None:
    factors = {"%": 100, "mm": 1e3, "cm": 100, "mrad": 1e3, "°": 180 / np.pi, "m": 1}
    for said, text in numbers(shipped):
        shown = re.fullmatch(r"(−?[\d,]+\.?(\d*))(?:.±.[\d.]+)?[ \xa0]?(%|mm|cm|mrad|°|m|)", text)
        assert shown is not None, text
        value = float(shown[1].replace("−", "-").replace(",", ""))
        half = 0.5000001 * 10.0 ** -len(shown[2])
        possible = [factors[shown[3]]] if shown[3] else [1, 100, 1e3]  # in a table the unit is in the heading
        assert any(abs(value - factor * said["value"]) <= half for factor in possible), text


def test_no_number_was_typed(shipped: str) -> None:
    words = WORDS.read_text("utf-8")
    assert re.search(r"\d", without(words, r"\{.*?\}", "`.*?`", CITATION)) is None
    body = shipped[shipped.index("<body>") : shipped.index("<h2>Sources</h2>")]
    text = without(
        body, "<svg.*?</svg>", "<math.*?</math>", "<code>.*?</code>", NUMBER.pattern, "<.*?>", CITATION
    )
    assert re.findall(r".{0,30}\d.{0,30}", unescape(text)) == []


def test_every_paper_that_is_cited_is_listed(shipped: str) -> None:
    cited = {name for citation in re.findall(CITATION, shipped) for name in re.findall("[A-Z]{3,}", citation)}
    assert cited == {source[1 : source.index("]")] for source in SOURCES}


class Outline(HTMLParser):
    """What a page refers to, and which elements are open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.references += [
            value or "" for name, value in attrs if name in ("href", "src", "srcset", "action")
        ]
        if tag not in ("meta", "link"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_needs_nothing_else(shipped: str) -> None:
    outline = Outline()
    outline.feed(shipped)
    outline.close()
    assert outline.open == []
    assert outline.references == ["data:,", "./"]  # no icon, and the way back
    assert outline.tags.isdisjoint({"script", "img", "iframe", "object"})
    assert "url(" not in shipped
    assert "@import" not in shipped
    assert len(shipped) < 400_000


def clouds(page: str) -> list[tuple[list[float], str]]:
    """Shares said above each drawing of dots in ellipses, and the drawing."""
    found = re.findall(r"<p>([^<]*: (?:published|consistent) <data.*?)</p>(<svg.*?</svg>)", page)
    return [([said["value"] for said, _ in numbers(title)], drawing) for title, drawing in found]


def inside(drawing: str) -> list[float]:
    """Share of the dots inside each ellipse, as drawn."""
    (path,) = re.findall(r'<path class="dots scan" d="([^"]*)"', drawing)
    dots = np.array([[float(x), float(y)] for x, y in re.findall(r"M([\d.-]+) ([\d.-]+)h0", path)])
    assert len(dots) == GuideDesign().scans
    shares = []
    for rx, ry, x, y, turn in re.findall(
        r'<ellipse [^>]*rx="([\d.]+)" ry="([\d.]+)" transform="translate\(([\d.]+) ([\d.]+)\) rotate\(([\d.-]+)\)"',
        drawing,
    ):
        angle = np.radians(float(turn))
        along = (dots - [float(x), float(y)]) @ np.array(
            [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        )
        shares.append(float((((along / [float(rx), float(ry)]) ** 2).sum(1) <= 1).mean()))
    return shares


def test_as_many_dots_are_drawn_inside_the_ellipses_as_is_said(shipped: str) -> None:
    drawn = clouds(shipped)
    assert len(drawn) == 14
    for said, drawing in drawn:
        assert len(said) == drawing.count("<ellipse")
        assert inside(drawing) == pytest.approx(said, abs=1 / GuideDesign().scans)  # one dot on the line


def test_bars_are_as_long_as_what_is_written_beside_them(shipped: str) -> None:
    drawings = re.findall(r'<svg[^>]*aria-label="Coverage[^"]*".*?</svg>', shipped)
    (drawing,) = drawings
    rows = re.findall(r'<rect [^>]*width="([\d.]+)"/>.*?<text class="value"[^>]*>([\d.]+) %</text>', drawing)
    assert len(rows) == 12
    lengths, shares = np.array(rows, float).T
    assert np.allclose(lengths / shares, (lengths / shares).mean(), rtol=5e-3)


@pytest.mark.long
def test_a_name_that_there_is_not_is_no_empty_place(fresh: Measurement) -> None:
    for words in ("{nothing:1%}", "{papers[cwlf nothing]:1}", "![nothing]"):
        with pytest.raises(KeyError, match="nothing"):
            list(sections(words, values(fresh), {}))
    with pytest.raises(ValueError, match="no format"):
        list(sections("{scans:furlongs}", values(fresh), {}))
