"""The verdicts on claims of [CWLF] and [WCTLS]: made-up results on both sides of every limit, and real reports."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
import pytest
from chance import fewest
from html_tables import Tables

from lidarcore.evaluation.intervals import Interval
from lidarcore.experiments import cwlf, wctls
from lidarcore.experiments.claim_rules import (
    Claim,
    as_large,
    below,
    every,
    in_range,
    median_ratio,
    nearer,
    percentages,
    within,
)
from lidarcore.experiments.corner_study import CornerStudy
from lidarcore.experiments.cwlf_claims import claims as claims_of_cwlf
from lidarcore.experiments.cwlf_report import html as report_of_cwlf
from lidarcore.experiments.cwlf_timing import Times
from lidarcore.experiments.environments import Design
from lidarcore.experiments.wctls_claims import claims as claims_of_wctls
from lidarcore.experiments.wctls_report import html as report_of_wctls
from lidarcore.reporting import Agreement
from lidarcore.scan import Array


def at(value: float, half: float = 0.0) -> Interval:
    return Interval(value, value - half, value + half)


@pytest.mark.parametrize(
    ("verdict", "expected"),
    [
        (below(at(0.9, 0.05), 1), True), (below(at(1.1, 0.05), 1), False), (below(at(0.98, 0.05), 1), None),
        (below(at(1.0), 1), False), (below(at(0.999), 1), True),
        (as_large(at(7.2), 7.2), True), (as_large(at(8.9), 7.2), True), (as_large(at(9.1), 7.2), False),
        (as_large(at(5.5), 7.2), True), (as_large(at(5.3), 7.2), False), (as_large(at(9.0, 0.5), 7.2), None),
        (within(at(3, 0.5), 2, 4), True), (within(at(5, 0.5), 2, 4), False), (within(at(4, 0.5), 2, 4), None),
        (in_range(Interval(4, 2.3, 7.4), 3, 6), True), (in_range(Interval(4, 2.2, 7.4), 3, 6), False),
        (in_range(Interval(4, 2.3, 7.6), 3, 6), False), (in_range(Interval(1.3, 1.1, 1.7), 2, 4), False),
        (percentages([60.5, 79.5], 70), True), (percentages([59.5, 70], 70), False),
        (percentages([70, 80.5], 70), False),
        (nearer(at(0.93, 0.01), at(0.8, 0.01), 0.95), True), (nearer(at(0.8, 0.01), at(0.93, 0.01), 0.95), False),
        (nearer(at(0.99, 0.001), at(0.93, 0.001), 0.95), False), (nearer(at(0.9, 0.02), at(0.88, 0.02), 0.95), None),
        (every([True, True]), True), (every([True, None]), None), (every([None, False]), False),
    ],
)  # fmt: skip
def test_rules_change_their_verdict_at_their_limits(verdict: bool | None, expected: bool | None) -> None:
    assert verdict is expected


def test_intervals_of_ratios_of_medians_hold_the_true_one_as_often_as_they_say() -> None:
    rng = np.random.default_rng(7)
    draws = [(rng.lognormal(1.0, 0.5, 150), rng.lognormal(0.0, 0.3, 150)) for _ in range(400)]
    inside = sum(median_ratio(a, b).contains(np.e) for a, b in draws)
    assert inside >= fewest(400, 0.95)  # intervals that hold 0.85 would be caught


@pytest.fixture(scope="module")
def of_cwlf() -> cwlf.CwlfStudy:
    return cwlf.run(Design(seed=3).quick())


@pytest.fixture(scope="module")
def of_wctls() -> wctls.WctlsStudy:
    return wctls.run(Design(seed=3, split_threshold=wctls.THRESHOLD).quick())


def verdict(claims: list[Claim], begins: str, room: str = "") -> Agreement:
    (found,) = [agrees for claim, _, agrees in claims if re.match(begins, claim) and room in claim]
    return found


Change = Callable[[CornerStudy], CornerStudy]
Of = TypeVar("Of", cwlf.CwlfStudy, wctls.WctlsStudy)


def with_claims(fitter: str, of: str, factors: Array | float, kind: str = "published") -> Change:
    """Covariances of one fitter are those of another times something."""

    def change(study: CornerStudy) -> CornerStudy:
        key, other = (fitter, kind), (of, kind)
        trials = replace(
            study.trials[key],  # type: ignore[index]
            covariances=study.trials[other].covariances * factors,  # type: ignore[index]
        )
        return replace(study, trials={**study.trials, key: trials})  # type: ignore[dict-item]

    return change


def with_errors(fitter: str, of: str, change_errors: Callable[[Array], Array]) -> Change:
    def change(study: CornerStudy) -> CornerStudy:
        errors = change_errors(study.trials[of, "published"].errors)
        trials = {
            key: replace(t, errors=errors) if key[0] == fitter else t for key, t in study.trials.items()
        }
        return replace(study, trials=trials)

    return change


def changed(result: Of, *changes: Change) -> Of:
    """The same result but for the studies of its rooms."""
    environments = []
    for environment in result.environments:
        study = environment.study
        for change in changes:
            study = change(study)
        environments.append(replace(environment, study=study))
    return replace(result, environments=environments)


def cwlf_with(result: cwlf.CwlfStudy, *changes: Change) -> list[Claim]:
    return claims_of_cwlf(changed(result, *changes))


def wctls_with(result: wctls.WctlsStudy, *changes: Change) -> list[Claim]:
    return claims_of_wctls(changed(result, *changes))


@pytest.mark.parametrize(("larger", "expected"), [(0, True), (1, True), (2, False)])
def test_save_one_corner_means_one(of_cwlf: cwlf.CwlfStudy, larger: int, expected: bool) -> None:
    def change(study: CornerStudy) -> CornerStudy:
        factors = np.where(np.arange(len(study.corners)) < larger, 1.1, 0.9)[:, None, None, None]
        return with_claims("cwlf", "arras_siegwart", factors)(study)

    for room in ("environment A", "environment B"):
        assert verdict(cwlf_with(of_cwlf, change), "Save one corner", room) is expected


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [(0.68, 0.65, True), (0.83, 0.65, True), (0.87, 0.65, False), (0.68, 0.47, False), (0.36, 0.34, False)],
)
def test_means_must_be_of_the_papers_ratio(
    of_cwlf: cwlf.CwlfStudy, x: float, y: float, expected: bool
) -> None:
    claims = cwlf_with(of_cwlf, with_claims("cwlf", "arras_siegwart", np.outer([x, y], [x, y])))
    assert verdict(claims, "By these means", "environment A") is expected
    assert verdict(claims, "On average", "environment A") == "not comparable"
    assert verdict(claims, "By these means", "environment B") is False  # the paper has 1.02 and 0.51


@pytest.mark.parametrize(("factor", "expected"), [(0.99, True), (1.01, False)])
def test_accuracy_is_of_errors(of_cwlf: cwlf.CwlfStudy, factor: float, expected: bool) -> None:
    claims = cwlf_with(of_cwlf, with_errors("cwlf", "arras_siegwart", lambda e: factor * e))
    assert verdict(claims, "CWLF has higher levels of accuracy", "environment A") is expected


@pytest.mark.parametrize(("factor", "expected"), [(1.5, True), (1.0, None), (0.5, False), (0.01, False)])
def test_realism_is_that_more_of_the_corners_are_where_they_are_said_to_be(
    of_cwlf: cwlf.CwlfStudy, of_wctls: wctls.WctlsStudy, factor: float, expected: bool | None
) -> None:
    """Arras-Siegwart's ellipses hold too few of the corners here; so do those of UTLS when they are shrunk."""
    changes = (
        with_errors("cwlf", "arras_siegwart", lambda e: e), with_claims("cwlf", "arras_siegwart", factor),
    )  # fmt: skip
    assert verdict(cwlf_with(of_cwlf, *changes), "The correlation", "environment B") is expected
    changes = (
        with_claims("utls", "utls", 0.5), with_errors("wctls", "utls", lambda e: e),
        with_claims("wctls", "utls", factor),
    )  # fmt: skip
    assert verdict(wctls_with(of_wctls, *changes), "WCTLS makes landmarks", "environment B") is expected


def with_times(result: cwlf.CwlfStudy, cwlf_us: float, steps: tuple[tuple[float, ...], ...]) -> list[Claim]:
    """Arras-Siegwart takes 100 µs for any corner."""
    totals = {"arras_siegwart": 100.0, "cwlf": cwlf_us}
    return claims_of_cwlf(
        replace(
            result,
            times={key: Times((totals[key[0]], 0, 0, 0), 1) for key in result.times},
            step_times={key: Times(steps[cwlf.FITTERS.index(key[1])], 1) for key in result.step_times},
        )
    )


@pytest.mark.parametrize(
    ("cwlf_us", "arras_siegwart", "line", "expected"),
    [
        (99, 70, 60, (True, True, True)), (101, 61, 69, (False, True, True)),
        (50, 59, 71, (True, False, False)), (50, 81, 49, (True, False, False)), (50, 54, 83, (True, False, False)),
    ],
)  # fmt: skip
def test_times_and_their_shares(
    of_cwlf: cwlf.CwlfStudy, cwlf_us: float, arras_siegwart: float, line: float, expected: tuple[bool, ...]
) -> None:
    steps = (100 - arras_siegwart, arras_siegwart, 0, 0), (line, 100 - line, 0, 0)
    claims = with_times(of_cwlf, cwlf_us, steps)
    begins = ("The time of CWLF", "Arras-Siegwart spends", "CWLF spends")
    assert tuple(verdict(claims, of) for of in begins) == expected
    assert verdict(claims, "CWLF stays in the order of µs") == "not comparable"


@pytest.mark.parametrize(
    ("falls", "expected"),
    [((30, 15), True), ((39, 6), True), ((41, 15), False), ((30, 4), False), ((35, 1), False)],
)
def test_the_chosen_corner_must_fall_as_much_as_in_the_paper(
    of_cwlf: cwlf.CwlfStudy, falls: tuple[float, float], expected: bool
) -> None:
    share = {"cwlf": 1 - np.array(falls) / 100, "arras_siegwart": np.ones(2)}
    uncertainties = {
        key: replace(u, published=0.02 * share[key[1]]) for key, u in of_cwlf.uncertainties.items()
    }
    claims = claims_of_cwlf(replace(of_cwlf, uncertainties=uncertainties))
    assert verdict(claims, "At the chosen corner of environment A") is expected
    assert verdict(claims, "At the chosen corner of environment B") is False  # 78 and 68 % in the paper


@pytest.mark.parametrize(("factor", "expected"), [(0.99, True), (1.01, False)])
def test_more_measurements_must_scatter_less(of_cwlf: cwlf.CwlfStudy, factor: float, expected: bool) -> None:
    _, many = cwlf.COMPARED
    uncertainties = {
        key: replace(u, scatter=np.full(2, 0.01 * (factor if key[2] == many else 1)))
        for key, u in of_cwlf.uncertainties.items()
    }
    claims = claims_of_cwlf(replace(of_cwlf, uncertainties=uncertainties))
    assert verdict(claims, "The more measurements") is expected


@pytest.mark.parametrize(("apart", "expected"), [(0.95, True), (1.05, False)])
def test_places_are_equivalent_if_they_are_nearer_to_each_other_than_to_the_truth(
    of_wctls: wctls.WctlsStudy, apart: float, expected: bool
) -> None:
    claims = wctls_with(of_wctls, with_errors("wctls", "utls", lambda e: (1 + apart) * e))
    assert verdict(claims, "All three methods", "environment A") is expected


@pytest.mark.parametrize(("sigma", "expected"), [(1.04, True), (1.06, False), (0.96, True), (0.94, False)])
def test_a_few_per_cent_are_five(of_wctls: wctls.WctlsStudy, sigma: float, expected: bool) -> None:
    claims = wctls_with(of_wctls, with_claims("wtls", "utls", sigma**2))
    assert verdict(claims, "UTLS and WTLS claim nearly", "environment A") is expected


@pytest.mark.parametrize(
    ("factor", "in_a", "in_b"),
    [(3.6, True, True), (2.2, False, True), (7.6, False, False), (1.3, False, False)],
)
def test_factors_of_the_standard_deviations(
    of_wctls: wctls.WctlsStudy, factor: float, in_a: bool, in_b: bool
) -> None:
    claims = wctls_with(of_wctls, with_claims("wctls", "utls", factor**-2))
    assert verdict(claims, "WCTLS claims standard deviations", "environment A") is in_a
    assert verdict(claims, "WCTLS claims standard deviations", "environment B") is in_b


@pytest.mark.parametrize(
    ("factor", "in_a", "in_b"),
    [(7.2, True, False), (8.7, True, False), (11.9, False, False), (2.0, False, True)],
)
def test_areas_must_be_of_the_papers_ratio(
    of_wctls: wctls.WctlsStudy, factor: float, in_a: bool, in_b: bool
) -> None:
    claims = wctls_with(of_wctls, with_claims("wctls", "utls", 1 / factor))
    for room, expected in (("environment A", in_a), ("environment B", in_b)):
        assert verdict(claims, "The median ellipse of WCTLS is smaller", room) is expected
        assert verdict(claims, "The median ellipse area per scan", room) == "not comparable"


@pytest.mark.parametrize(("factor", "expected"), [(0.9, True), (1.1, False)])
def test_dispersion_is_of_the_areas(of_wctls: wctls.WctlsStudy, factor: float, expected: bool) -> None:
    claims = wctls_with(of_wctls, with_claims("wctls", "utls", factor))
    assert verdict(claims, "The dispersion", "environment A") is expected


@pytest.mark.parametrize(("factor", "expected"), [(0.94, True), (0.96, False), (1.0, False)])
def test_a_gain_must_be_one(of_wctls: wctls.WctlsStudy, factor: float, expected: bool) -> None:
    claims = wctls_with(of_wctls, with_claims("wctls", "wtls", factor, "consistent"))
    assert verdict(claims, "The gain comes", "environment A") is expected


@pytest.mark.parametrize(("many", "expected"), [(12, True), (13, False)])
def test_complexity_is_growth(of_wctls: wctls.WctlsStudy, many: float, expected: bool) -> None:
    times = {key: 1.0 if key[1] == wctls.POINTS[0] else 10.0 for key in of_wctls.times}
    times["wctls", wctls.POINTS[1]] = many
    assert verdict(claims_of_wctls(replace(of_wctls, times=times)), "WCTLS does not increase") is expected


Row = tuple[str, str, str]


@pytest.fixture(scope="module")
def rows(of_cwlf: cwlf.CwlfStudy, of_wctls: wctls.WctlsStudy) -> list[Row]:
    """Claim, what was measured and verdict, as both reports show them."""
    shown = []
    for report in (report_of_cwlf(of_cwlf), report_of_wctls(of_wctls)):
        _, *claims = Tables(report).rows[""]  # the first table has no caption
        shown += [(claim, measured, word) for claim, measured, word in claims]
    return shown


def intervals(text: str) -> list[tuple[float, float]]:
    return [(float(a), float(b)) for a, b in re.findall(r"\(([\d.]+) to ([\d.]+)\)", text)]


def test_reports_say_of_every_claim_whether_it_agrees_and_why_not(
    rows: list[Row], of_cwlf: cwlf.CwlfStudy, of_wctls: wctls.WctlsStudy
) -> None:
    claims = [*claims_of_cwlf(of_cwlf), *claims_of_wctls(of_wctls)]
    words = {True: "agrees", False: "differs", None: "open", "not comparable": "not comparable"}
    assert rows == [(claim, measured, words[agrees]) for claim, measured, agrees in claims]
    absolute = [claim for claim, _, word in rows if word == "not comparable"]
    assert len(absolute) == 5
    for _, measured, word in rows:
        assert ("Not comparable: " in measured) == (word == "not comparable")
        if word == "differs":
            assert re.search(r"[.)] [A-Z][^.]{20,}\.( [A-Z].*)?$", measured), measured


def expected_of_ratios(found: list[tuple[float, float]], paper: list[float]) -> str:
    """By arithmetic of its own: all within a quarter, one wholly outside, or neither."""
    inside = [0.75 * p <= low and high <= 1.25 * p for (low, high), p in zip(found, paper, strict=True)]
    outside = [high < 0.75 * p or low > 1.25 * p for (low, high), p in zip(found, paper, strict=True)]
    return "differs" if any(outside) else "agrees" if all(inside) else "open"


def test_verdicts_follow_from_the_numbers_beside_them(rows: list[Row]) -> None:
    seen = 0
    for claim, measured, word in rows:
        found = intervals(measured)
        if means := re.match(r"By these means CWLF's σx, σy are ([\d.]+), ([\d.]+) times", claim):
            assert word == expected_of_ratios(found, [float(p) for p in means.groups()])
        elif area := re.match(r"The median ellipse of WCTLS is smaller by a factor of ([\d.]+) \(", claim):
            assert word == expected_of_ratios(found, [float(area[1])])
        elif claim.startswith(("CWLF has higher", "The dispersion", "All three")):
            low, high = found[0]
            assert word == ("agrees" if high < 1 else "differs" if low >= 1 else "open")
        elif claim.startswith(
            ("The correlation", "WCTLS makes")
        ):  # all shares are below 95 % but for that of UTLS
            (low, high), (_, other_high) = found[:2]
            assert high < 94
            assert word == ("differs" if 95 - high > abs(95 - other_high) else "agrees")
        elif share := re.match(r".* spends (\d+) % of its time", claim):
            ends = re.match(r"(\d+) to (\d+) %", measured)
            assert ends
            if all(
                abs(abs(float(end) - float(share[1])) - 10) > 1 for end in ends.groups()
            ):  # as it is rounded
                apart = max(abs(float(end) - float(share[1])) for end in ends.groups())
                assert word == ("agrees" if apart <= 10 else "differs")
        else:
            continue
        seen += 1
    assert seen == 16
