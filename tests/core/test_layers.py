"""The packages of the library form layers, and the application uses only what they offer."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path
from types import FunctionType

import pytest

import lidarcore

ROOT = Path(lidarcore.__file__).parent


def imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "lidarcore":
            parts = node.module.split(".")
            yield from ([parts[1]] if len(parts) > 1 else [name.name for name in node.names])
        if isinstance(node, ast.Import):
            yield from (name.name.split(".")[1] for name in node.names if name.name.startswith("lidarcore."))


def layer(path: Path) -> str:
    first = path.relative_to(ROOT).parts[0]
    return first.removesuffix(".py")


def test_no_two_packages_import_each_other() -> None:
    needs: dict[str, set[str]] = defaultdict(set)
    for path in ROOT.rglob("*.py"):
        if path != ROOT / "__init__.py":  # it gathers what is public
            needs[layer(path)] |= {name for name in imports(path) if name != layer(path)}
    assert {"geometry", "localization", "reporting"} <= set(needs)
    TopologicalSorter(needs).prepare()  # raises CycleError, which names the cycle


APP = ROOT.parent / "app"
PUBLIC = (
    "lidarcore",
    *(
        f"lidarcore.{name}"
        for name in (
            "client",
            "clusters",
            "evaluation",
            "evaluation.calibration",
            "evaluation.consistency",
            "evaluation.maps",
            "evaluation.repeatability",
            "evaluation.speed",
            "evaluation.stations",
            "experiments",
            "geometry",
            "landmarks",
            "localization",
            "mapping",
            "recordings",
            "reporting",
            "rplidar",
            "simulation",
        )
    ),
)
"""Packages whose `__all__` is what they offer; a module named there is public with all its names."""


def is_public(module: str, name: str) -> bool:
    if module in PUBLIC:
        return f"{module}.{name}" in PUBLIC or name in import_module(module).__all__
    package, _, inner = module.rpartition(".")
    return not name.startswith("_") and package in PUBLIC and inner in import_module(package).__all__


@pytest.mark.parametrize("module", PUBLIC)
def test_all_that_is_public_is_there_and_documented(module: str) -> None:
    package = import_module(module)
    for name in package.__all__:
        if not hasattr(package, name):
            import_module(f"{module}.{name}")
        value = getattr(package, name)
        assert not isinstance(value, type | FunctionType) or value.__doc__, (
            f"{module}.{name} has no docstring"
        )


def test_the_application_uses_nothing_but_what_is_public() -> None:
    private = [
        f"{path.relative_to(APP)}: from {node.module} import {name.name}"
        for path in sorted(APP.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "lidarcore"
        for name in node.names
        if not is_public(str(node.module), name.name)
    ]
    assert not private
