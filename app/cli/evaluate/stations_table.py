"""A study of stations on the terminal."""

from rich.table import Table

from lidarcore.evaluation.stations.limits import REFERENCE, limits
from lidarcore.evaluation.stations.study import Figures, StationStudy

from ..tables import span, table


def methods_table(study: StationStudy) -> Table:
    """Every method's walls and corners, all stations together."""
    shares = ("in 95 %", "lowest, highest station", "claimed / scatter", f"scatter / {REFERENCE}")
    result = table(
        f"{len(study.stations)} stations: 95 % ellipses against the scatter",
        ("of", "fitter"),
        (*shares, "features", "seen"),
    )
    for name, figures in (("walls", study.walls), ("corners", study.corners)):
        for m, method in enumerate(study.methods):
            extremes = figures.extremes(m)
            result.add_row(
                name,
                method,
                span(figures.coverage(m), 3),
                "" if extremes is None else f"{extremes[0]:.2f}, {extremes[1]:.2f}",
                span(figures.area_ratio(m), 2),
                _against(study, figures, m),
                str(int((figures.counts[:, m] > 0).sum())),
                f"{figures.sightings(m):,}",
            )
        result.add_section()
    return result


def limits_table(study: StationStudy) -> Table:
    """The first method's figures beside what is asked of them."""
    result = table(f"Asked of {study.methods[0]}", ("of", "figure"), ("measured", "asked", ""))
    for limit in limits(study, study.methods[0]):
        asked = "–".join(f"{end:g}" for end in (limit.low, limit.high) if end is not None)
        sign = (
            "" if limit.low is not None and limit.high is not None else "≥ " if limit.high is None else "≤ "
        )
        result.add_row(
            limit.of, limit.figure, f"{limit.value:.3f}", sign + asked, "held" if limit.held else "missed"
        )
    return result


def station_table(study: StationStudy) -> Table:
    """The first method's coverage at each station, and the noise it was judged with."""
    figures = ("scans", "walls in 95 %", "seen", "corners in 95 %", "seen", "noise")
    result = table(f"By station, {study.methods[0]}", ("station",), figures)
    walls, corners = study.walls.by_station(0), study.corners.by_station(0)
    for number, station in enumerate(study.stations):
        cells = [_held(held.get(number)) for held in (walls, corners)]
        noise = station.noise
        result.add_row(
            station.name,
            str(station.scans),
            *cells[0],
            *cells[1],
            f"{1e3 * noise.sigma_range:.1f} mm + {1e3 * noise.range_growth:.2f} mm/m² "
            f"{1e3 * noise.sigma_bearing:.2f} mrad, uneven {1e3 * noise.unevenness:.1f} mm "
            f"over {1e2 * noise.unevenness_length:.0f} cm",
        )
    return result


def _held(held: tuple[float, int] | None) -> tuple[str, str]:
    return ("", "") if held is None else (f"{held[0]:.3f}", str(held[1]))


def _against(study: StationStudy, figures: Figures, m: int) -> str:
    if REFERENCE not in study.methods or study.methods[m] == REFERENCE:
        return ""
    return span(figures.scatter_against(m, study.methods.index(REFERENCE)), 2)
