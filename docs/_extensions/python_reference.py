"""A page for every package of lidarcore that says in `__all__` what of it is public, from its docstrings.

The pages are written beside their index before the others are read; they are no part of the repository.
"""

import importlib
import pkgutil
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import lidarcore

FOLDER = Path(__file__).parents[1] / "reference" / "python"
PAGE = """# {name}

```{{eval-rst}}
.. automodule:: {name}
   :members: {members}
```
"""
PART = """
## {name}

```{{eval-rst}}
.. automodule:: {name}
   :members:
```
"""


def write_pages(app: Any) -> None:
    """A thing that several packages offer is described in the first of them, the whole library before its parts."""
    homes: dict[int, str] = {}
    packages = public_packages()
    for name, package in packages.items():
        here = [
            member
            for member in package.__all__
            if member in vars(package)  # what comes on demand is described where it is made
            and homes.setdefault(id(getattr(package, member)), name) == name
            and _is_described(getattr(package, member))
        ]
        # Modules that are public as such; a name that a function shares with its module is the function's.
        others = [
            f"{name}.{member}"
            for member in package.__all__
            if isinstance(vars(package).get(member, package), ModuleType)
        ]
        parts = [other for other in others if other not in packages and find_spec(other)]
        text = PAGE.format(name=name, members=", ".join(here)) if here else f"# {name}\n\n{package.__doc__}\n"
        _write(FOLDER / f"{name}.md", text + "".join(PART.format(name=part) for part in parts))


def _write(path: Path, text: str) -> None:
    """Unless it stands there already: what has not changed is not read again."""
    if not path.is_file() or path.read_text("utf-8") != text:
        path.write_text(text, "utf-8")


def public_packages() -> dict[str, ModuleType]:
    """The packages with `__all__`, the whole library first."""
    names = [m.name for m in pkgutil.walk_packages(lidarcore.__path__, "lidarcore.") if m.ispkg]
    modules = {name: importlib.import_module(name) for name in ["lidarcore", *names]}
    return {name: module for name, module in modules.items() if hasattr(module, "__all__")}


def _is_described(value: Any) -> bool:
    """Classes and functions of Python; compiled kernels and plain values have no docstring that Sphinx could read."""
    return isinstance(value, type) or type(value).__name__ in ("function", "_lru_cache_wrapper")


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
