"""The list of recording formats from the classes that read them."""

from typing import Any

from generated import cell, install, table


def write() -> str:
    """Name and description of every format."""
    from lidarcore.recordings import FORMATS

    rows = [(cell(f.name), cell((f.__doc__ or "").strip().split("\n\n")[0])) for f in FORMATS]
    return table(("format", "what is read"), rows)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    return install(app, "formats", write)
