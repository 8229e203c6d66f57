"""The report of the experiment of [CWLF]: its tables I and II and figures 3 to 5, its claims beside what came out."""

import numpy as np

from lidarcore import reporting
from lidarcore.experiments.corner_study import CornerStudy
from lidarcore.experiments.corner_tables import honesty, legend, maps, methods, sigmas
from lidarcore.experiments.cwlf import COMPARED, FITTERS, MEASUREMENTS, CwlfStudy
from lidarcore.experiments.cwlf_claims import claims
from lidarcore.experiments.cwlf_steps import STEPS
from lidarcore.experiments.environments import of_verdicts, set_up
from lidarcore.experiments.paper_rooms import CWLF_ROOMS
from lidarcore.reporting import Bar, bars, curves

TITLE = "Corners by conditional weighted linear fitting, and by Arras and Siegwart"
STYLES = {"arras_siegwart": "m0", "cwlf": "m1"}
_TIMES = (
    "Times. The steps are timed in numpy, in which a step costs some µs however few points it has; the paper does "
    "not say in what language its steps were. The quadratic growth of Arras-Siegwart is that of the double sums "
    "in equation 17; they factor into moments, after which both methods take time proportional to the points."
)
_CHOSEN = (
    "Figures 3 to 5 are of one corner of each room: of 130° in environment A, of 90° in environment B, as in the "
    "paper. Its beams are spread evenly over the two walls as far as they are in view, half of them on each."
)
_SHORT = {"arras_siegwart": "Arras-Siegwart", "cwlf": "CWLF"}


def html(result: CwlfStudy) -> str:
    """The report as one page that needs nothing else."""
    lead = (
        "The experiment of N. Prieto-Fernández et al., “Conditional Weighted Linear Fitting for 2D-LiDAR-Mapping of "
        "Indoor SLAM” (IEEE Transactions on Industrial Informatics 20(7), 2024), run again. Beside what each method "
        "claims of its corners stands how they truly scatter. Brackets give 95 % confidence intervals."
    )
    chosen = [_CHOSEN] if result.times else []
    sections = [
        (
            "What the paper says and what came out",
            reporting.verdicts(claims(result)) + reporting.paragraphs(*_why(result)),
        ),
        (
            "Uncertainty of every corner (tables I and II)",
            "".join(sigmas(e, FITTERS, n) for e, n in zip(result.environments, ("I", "II"), strict=False)),
        ),
        ("Where the corners are (figure 2)", "".join(maps(e, STYLES) for e in result.environments)),
        ("Can the ellipses be believed?", "".join(honesty(e, FITTERS) for e in result.environments)),
        *(_of_chosen_corners(result) if result.times else []),
        (
            "How this was made",
            reporting.bullets([*set_up(result.design, result.environments), *chosen, methods(FITTERS)]),
        ),
    ]
    return reporting.page(TITLE, lead, sections)


def _of_chosen_corners(result: CwlfStudy) -> list[tuple[str, str]]:
    return [
        ("Time against the number of measurements (figure 3)", _figure3(result)),
        ("One corner, two numbers of measurements (figures 4 and 5)", _figures45(result)),
    ]


def _why(result: CwlfStudy) -> list[str]:
    known = [e.study for e in result.environments if e.study.bounds is not None]
    below = (
        f"Here its published ellipse is below the bound at {sum(s.below_bound('cwlf') for s in known)} of "
        f"{sum(len(s.corners) for s in known)} corners: no unbiased method can be that good. "
        if known
        else ""
    )
    return [
        *of_verdicts(result.design, bool(known)),
        "Why the published uncertainty of CWLF is so small. Its weights are the inverse variances of y for an x that "
        "is known (equation 13), and 1/Σw is then taken as the variance of the line (equations 31 and 32). But x is "
        "not known: range noise moves a point along its beam, off the wall by its full component across. The "
        "conditional variance is smaller than that at every beam that meets its wall at an angle, without limit as "
        f"the bearing becomes exact. {below}The consistent covariance propagates the full variance through "
        "the same estimator; but for a bias it is what scatters.",
        *_of_errors(known),
        *([_TIMES] if result.times else []),
    ]


def _of_errors(studies: list[CornerStudy]) -> list[str]:
    if not studies:
        return []
    ratios = " and ".join(f"{s.rms_ratio('cwlf', 'arras_siegwart').value:.2f}" for s in studies)
    biases = " and ".join(f"{100 * s.bias('cwlf'):.0f}" for s in studies)
    return [
        "How good the corners are is another question than what is claimed of them. The errors of CWLF are "
        f"{ratios} times those of Arras-Siegwart in the two rooms, where the published ellipses promise far more. "
        "Both take their weights, and what they regress on, from noisy points, so that lines are biased: mean errors "
        f"of CWLF are {biases} % of its RMS errors. No covariance holds a bias; that is why the consistent ellipses, "
        "too, hold fewer than 95 % with noise of 5 cm. The last row of the table, maximum likelihood on the ranges, "
        "shows what the same scans allow."
    ]


def _figure3(result: CwlfStudy) -> str:
    series = [
        (f"{STYLES[name]}{dashed}", [getattr(result.times[name, n], of) for n in MEASUREMENTS])
        for of, dashed in (("total", ""), ("library", " dashed"))
        for name in FITTERS
    ]
    drawn = curves(
        MEASUREMENTS, series, labels=("measurements", "µs"), title="Time by number of measurements"
    )
    ratio = [[result.times["cwlf", n].total / result.times["arras_siegwart", n].total for n in MEASUREMENTS]]
    share = curves(
        MEASUREMENTS,
        [("lost", ratio[0])],
        labels=("measurements", ""),
        title="Time of CWLF over Arras-Siegwart",
    )
    caption = (
        "Figure 3. Time for the chosen corner of environment A, both axes logarithmic: in numpy as the paper writes "
        "it, and dashed by the library's compiled code."
    )
    rows = [
        [
            f"{n}",
            *(f"{result.times[name, n].total:.1f}" for name in FITTERS),
            f"{ratio[0][k]:.3f}",
            *(f"{result.times[name, n].library:.2f}" for name in FITTERS),
        ]
        for k, n in enumerate(MEASUREMENTS)
    ]
    numpy, compiled = ([f"{_SHORT[name]}, {how}" for name in FITTERS] for how in ("numpy", "compiled"))
    headers = ["measurements", *numpy, "CWLF / Arras-Siegwart", *compiled]
    panels = [("time, µs", drawn), ("CWLF over Arras-Siegwart", share)]
    return reporting.figure(caption, panels, legend(STYLES)) + reporting.table(
        "Time of the chosen corner, µs", headers, rows
    )


def _figures45(result: CwlfStudy) -> str:
    parts = []
    for number, room in zip((4, 5), CWLF_ROOMS, strict=True):
        caption = (
            f"Figure {number}. The chosen corner of {room.name}: what is published (bar), how it truly scatters "
            "(whisker's end), and the time of each step."
        )
        parts.append(
            reporting.figure(caption, [_sigma_bars(result, room.name), _step_bars(result, room.name)])
        )
    sigmas_of = [
        f"{what} {axis}" for what in ("published", "scatter", "least possible") for axis in ("σx", "σy")
    ]
    headers = ("room", "method", "measurements", *sigmas_of)
    rows = [
        [
            room,
            _SHORT[name],
            str(n),
            *(f"{1e3 * x:.2f}" for of in (u.published, u.scatter, u.bound) for x in of),
        ]
        for (room, name, n), u in result.uncertainties.items()
    ]
    times = [
        [room, _SHORT[name], str(n), *(f"{x:.1f}" for x in t.steps), f"{t.total:.1f}"]
        for (room, name, n), t in result.step_times.items()
    ]
    return (
        "".join(parts)
        + reporting.table("Uncertainty of the chosen corners, mm", headers, rows, texts=2)
        + reporting.table(
            "Time of the four steps, µs", ("room", "method", "measurements", *STEPS, "all"), times, texts=2
        )
    )


def _sigma_bars(result: CwlfStudy, room: str) -> tuple[str, str]:
    cells = {(name, n): result.uncertainties[room, name, n] for n in COMPARED for name in FITTERS}
    most = 1e3 * max(float(np.max([u.published, u.scatter])) for u in cells.values())
    least = 1e3 * min(float(np.min([u.published, u.scatter])) for u in cells.values()) / 2
    rows: list[Bar | str] = []
    for n in COMPARED:
        for axis, word in enumerate(("x", "y")):
            rows.append(f"σ{word}, {n} measurements")
            for name in FITTERS:
                claimed, true = (
                    1e3 * float(v[axis]) for v in (cells[name, n].published, cells[name, n].scatter)
                )
                low, high = sorted((claimed, true))
                rows.append(
                    Bar(_SHORT[name], claimed, low, high, f"{claimed:.1f} ({true:.1f})", STYLES[name])
                )
    title = f"Published uncertainty, {room}"
    return "published (true), mm", bars(rows, most, least=least, title=title)


def _step_bars(result: CwlfStudy, room: str) -> tuple[str, str]:
    cells = {(name, n): result.step_times[room, name, n] for n in COMPARED for name in FITTERS}
    most, least = max(max(t.steps) for t in cells.values()), min(min(t.steps) for t in cells.values()) / 2
    rows: list[Bar | str] = []
    for n in COMPARED:
        for name in FITTERS:
            rows.append(f"{_SHORT[name]}, {n} measurements")
            for step, time in zip(STEPS, cells[name, n].steps, strict=True):
                label = step.replace("covariance of the ", "cov. of ")
                rows.append(Bar(label, time, time, np.nan, f"{time:.1f}", STYLES[name]))
    return "time of the steps, µs", bars(rows, most, least=least, title=f"Time of the four steps, {room}")
