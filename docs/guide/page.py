"""The guide as one page that needs nothing else."""

from collections.abc import Callable, Mapping
from functools import partial

from lidarcore import reporting

from . import charts, clouds, tables
from .formulas import formulas
from .measurement import Measurement
from .numbers import marked_up
from .patterns import pattern
from .text import WORDS, sections
from .values import values

TITLE = "Which ellipses can be believed?"
SOURCES = (
    "[CWLF] N. Prieto-Fernández, S. Fernández-Blanco, Á. Fernández-Blanco, J. A. Benítez-Andrades, "
    "F. Carro-De-Lorenzo, C. Benavides: Conditional Weighted Linear Fitting for 2D-LiDAR-Mapping of Indoor "
    "SLAM. IEEE Transactions on Industrial Informatics 20(7), 2024.",
    "[WCTLS] N. Prieto-Fernández et al.: Enhancement of the Total Least Squares Method for Feature Extraction in 2D "
    "LiDAR Mapped Environments. CMES 147(2), 2026.",
    "[EKF] R. Urvina Córdova, E. Aguilar Torres, A. Prado Romo: Localización Simultánea y Mapeo para Control de un "
    "Robot Móvil Autónomo usando Escaneo de Nube de Puntos LiDAR y Métodos de Aprendizaje de Máquina.",
)
_NO_ICON = '<link rel="icon" href="data:,">'  # else a browser asks the server for one
_BACK = '<p>This page, served by the program, leads back to the <a href="./">dashboard</a>.</p>'


def html(m: Measurement) -> str:
    """The page."""
    (_, lead), *parts = sections(WORDS.read_text("utf-8"), values(m), _pictures(m))
    body = [*parts, ("Sources", reporting.bullets(SOURCES) + _BACK)]
    page = reporting.page(TITLE, "", body).replace("<title>", f"{_NO_ICON}<title>", 1)
    return marked_up(page.replace('<p class="lead"></p>', f'<div class="lead">{lead}</div>'))


def _pictures(m: Measurement) -> Mapping[str, Callable[[], str]]:
    return {
        **{name: partial(clouds.corner, m, name) for name in m.views},
        "reasons": partial(clouds.wall, m),
        "ml": partial(clouds.likelihood, m),
        "formulas": formulas,
        **{
            chart.__name__: partial(chart, m)
            for chart in (charts.coverage, charts.anees, charts.areas, charts.bias)
        },
        "known": partial(tables.believable, m, "known"),
        "found": partial(tables.believable, m, "found"),
        "filtered": partial(tables.filtered, m),
        "fused": partial(tables.fused, m),
        "pattern": pattern,
        "real_claims": tables.real_claims,
        "real_scatter": tables.real_scatter,
    }
