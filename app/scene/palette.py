"""Colours and dashes of the methods, and the colours of what else is drawn, for a dark and a light page.

Those of the methods are told apart with any colour vision: tests/app/test_palette.py simulates it.
"""

from dataclasses import dataclass

import numpy as np

from .colours import Rgbs, rgb

PALETTE = {
    "dark": {
        "points": "#9fb0c8", "rejected": "#ff5c5c", "cluster": "#e58fd0", "trail": "#e8c468", "reckoned": "#5d5070",
        "true": "#4f8fd0", "association": "#c8d2e0", "ambiguous": "#ff9d5c", "free": "#232b36", "occupied": "#b3c1d3",
        "wall": "#6fd3e8", "landmark": "#5ad1a4", "tentative": "#6b7686",
    },
    "light": {
        "points": "#56657a", "rejected": "#c92a2a", "cluster": "#a83a90", "trail": "#a86f00", "reckoned": "#b9a8d0",
        "true": "#1f6fb8", "association": "#46536a", "ambiguous": "#c45a00", "free": "#e4eaf1", "occupied": "#27303b",
        "wall": "#0a7f97", "landmark": "#0b7a55", "tentative": "#9aa5b4",
    },
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class MethodStyle:
    """How a method is drawn: its colour on each ground, and the dash of its outlines, pixels drawn and left out."""

    dark: str
    light: str
    dash: tuple[int, ...] = ()


METHOD_STYLES = {
    "arras_siegwart": MethodStyle("#d69c17", "#dd7800", (1, 3)),
    "cwlf": MethodStyle("#41f6ff", "#208fe1", (9, 3)),
    "utls": MethodStyle("#addb99", "#113732", (5, 3)),
    "wtls": MethodStyle("#b09bac", "#a2567f", (9, 3, 2, 3)),
    "wctls": MethodStyle("#af98ff", "#3c20b2", (2, 2)),
    "ml": MethodStyle("#ee4972", "#ae2020"),
}


def method_rgb(name: str, theme: str) -> Rgbs:
    """A method's colour (3,) in a theme."""
    style = METHOD_STYLES[name]
    return np.array(rgb(style.dark if theme == "dark" else style.light), np.uint8)


def theme_colour(theme: str, name: str) -> Rgbs:
    """The colour (3,) of something in a theme."""
    return np.array(rgb(PALETTE[theme][name]), np.uint8)


def stylesheet() -> str:
    """The colours but those of the methods, as custom properties for the page: `--trail` and so on."""
    dark, light = PALETTE["dark"], PALETTE["light"]
    lines = (f"  --{name}: light-dark({light[name]}, {dark[name]});" for name in dark)
    return "\n".join((":root {", *lines, "}\n"))
