"""The report of the experiment of [WCTLS]: its tables 1 and 2, figures 3 and 4, its claims beside what came out."""

import numpy as np

from lidarcore import reporting
from lidarcore.evaluation.consistency.design import KINDS
from lidarcore.experiments.corner_tables import honesty, legend, maps, methods, sigmas
from lidarcore.experiments.environments import of_verdicts, set_up
from lidarcore.experiments.wctls import FITTERS, WctlsStudy
from lidarcore.experiments.wctls_claims import AREAS, claims
from lidarcore.lines import FITTERS as ALL
from lidarcore.reporting import boxes

TITLE = "Corners by weighted conformal total least squares"
STYLES = {"utls": "m0", "wtls": "m2", "wctls": "m3"}
_OF_ROOMS = (
    "Sizes. The paper's ellipses are larger; these are of other rooms, and of a bearing noise that the paper does "
    "not give. Ratios between methods depend on them as well, though less.",
    "The paper has no true positions, as it says itself: it compares claims with claims. With the truth known, the "
    "two classical methods turn out to claim what is so, and the smaller ellipses of WCTLS to hold too few of the "
    "corners.",
)


def html(result: WctlsStudy) -> str:
    """The report as one page that needs nothing else."""
    lead = (
        "The experiment of N. Prieto-Fernández et al., “Enhancement of the Total Least Squares Method for Feature "
        "Extraction in 2D LiDAR Mapped Environments” (Computer Modeling in Engineering & Sciences 147(2), 2026), run "
        "again. Beside what each method claims of its corners stands how they truly scatter. Brackets give 95 % "
        "confidence intervals."
    )
    tables = (sigmas(e, FITTERS, n) for e, n in zip(result.environments, "12", strict=False))
    figures = (maps(e, STYLES, "Figure 3. ", ", as in the paper") for e in result.environments)
    sections = [
        (
            "What the paper says and what came out",
            reporting.verdicts(claims(result)) + reporting.paragraphs(*_why(result)),
        ),
        (
            "Uncertainty of every corner (tables 1 and 2)",
            "".join(tables),
        ),
        (
            "The ellipses (figure 3)",
            "".join(figures),
        ),
        ("Median ellipse area of each scan (figure 4)", _figure4(result)),
        ("Can the ellipses be believed?", "".join(honesty(e, FITTERS) for e in result.environments)),
        (
            "How this was made",
            reporting.bullets([*set_up(result.design, result.environments), methods(FITTERS)]),
        ),
    ]
    return reporting.page(TITLE, lead, sections)


def _why(result: WctlsStudy) -> list[str]:
    known = [e.study for e in result.environments if e.study.bounds is not None]
    below = (
        f" Here it is below it at {sum(s.below_bound('wctls') for s in known)} of "
        f"{sum(len(s.corners) for s in known)} corners."
        if known
        else ""
    )
    return [
        *of_verdicts(result.design, bool(known)),
        "Why WCTLS claims less. The paper takes the covariance of the conformal point Q from an earlier one and does "
        "not print it. The information matrix of a regression with conditional variances, used here in its place, "
        "gains too; by how much depends on the room and on the bearing noise. It counts only that part of a point's "
        "error which is left when its coordinate along the wall is known, and that is smaller than the part across "
        "the wall at every beam that is not perpendicular: the claim can fall below the Cramér-Rao "
        f"bound.{below}",
        "Why the normalisation is not the reason. WCTLS solves the same weighted equations as WTLS and puts every "
        "corner in the same place. To first order the covariance of a corner does not depend on the scale or the "
        "parameters its lines are written in; propagated in full (“consistent”) the two agree to the last digit.",
        *(_OF_ROOMS if known else ()),
    ]


def _figure4(result: WctlsStudy) -> str:
    panels, rows = [], []
    for number, environment in enumerate(result.environments):
        study = environment.study
        groups = [
            (f"{ALL[name].title}\n{kind}", STYLES[name], 1e6 * study.scan_areas(name, kind))
            for kind in KINDS
            for name in FITTERS
        ]
        marks = [(k, 1e6 * study.actual_area(name)) for k, name in enumerate((*FITTERS, *FITTERS))]
        panels.append(
            (environment.name, boxes(groups, unit="mm²", title=f"Areas, {environment.name}", marks=marks))
        )
        for k, name in enumerate(FITTERS):
            areas = {kind: 1e6 * study.scan_areas(name, kind) for kind in KINDS}
            paper = "" if environment.room is None else "{:.1f} ± {:.1f}".format(*AREAS[number][k])
            cells = [f"{np.median(of):.1f} ± {of.std(ddof=1):.1f}" for of in areas.values()]
            rows.append(
                [environment.name, ALL[name].title, paper, *cells, f"{1e6 * study.actual_area(name):.1f}"]
            )
    caption = (
        "Figure 4. For each scan the median area of its one-sigma ellipses, mm², logarithmic: quartiles, median, "
        "whiskers of 1.5 times the interquartile range, outliers. Dashed: the true area, the median over the corners."
    )
    headers = ("room", "method", "the paper", "published", "consistent", "true area")
    table = reporting.table(
        "Median ellipse area per scan ± standard deviation over scans, mm²", headers, rows, texts=2
    )
    return reporting.figure(caption, panels, legend(STYLES)) + table
