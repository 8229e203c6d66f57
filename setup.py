"""Installed, everything lies under names of ours: `app` as `lidarcore_app`, the page in `lidarcore_app/static`.

The documentation comes along if `make docs` has built it.
"""

from pathlib import Path

from setuptools import find_packages, setup

DATA = {"demo": Path("app/demo"), "static": Path("static"), "documentation": Path("docs/_build/html")}

library = find_packages(include=["lidarcore", "lidarcore.*"])
application = [name.replace("app", "lidarcore_app", 1) for name in find_packages(include=["app", "app.*"])]
# setuptools wants every folder that could be a package to be called one.
data = [
    ".".join(["lidarcore_app", name, *inner.relative_to(folder).parts])
    for name, folder in DATA.items()
    for inner in [folder, *folder.rglob("*")]
    if inner.is_dir() and all(part.isidentifier() for part in inner.relative_to(folder).parts)
]

setup(
    packages=[*library, *application, *data],
    package_dir={
        "lidarcore": "lidarcore",
        "lidarcore_app": "app",
        **{f"lidarcore_app.{name}": str(folder) for name, folder in DATA.items()},
    },
    package_data={"": ["*"], **{f"lidarcore_app.{name}": ["**/*"] for name in DATA}},
)
