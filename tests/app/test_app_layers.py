"""The flow runs one way: sources < pipeline < scene, jobs < web < command line; only web knows HTTP and JSON."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

APP = Path(__file__).parents[2] / "app"
BASE = {"errors", "isolation", "records"}
MAY_IMPORT = {
    "errors": set(),
    "isolation": set(),
    "records": set(),
    "sources": BASE,
    "pipeline": BASE | {"sources"},
    "scene": BASE | {"sources", "pipeline"},
    "jobs": BASE | {"sources", "pipeline"},
    "web": BASE | {"sources", "pipeline", "scene", "jobs"},
    "cli": BASE | {"sources", "pipeline", "jobs", "benchmarks"},
    "benchmarks": BASE | {"sources", "pipeline", "scene", "jobs", "web", "cli"},
}
SERVING = {"cli/serve.py"}  # starts the server, so it imports web
HTTP = {"fastapi", "starlette", "uvicorn", "websockets"}


def modules() -> list[str]:
    return sorted(str(path.relative_to(APP)) for path in APP.rglob("*.py"))


def imported(module: str) -> Iterator[tuple[str, ...]]:
    """Absolute names of what a module imports, from the name of its top-level package on; ours from `app`."""
    package = ("app", *Path(module).parent.parts)
    for node in ast.walk(ast.parse((APP / module).read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            origin = (*base, *(node.module or "").split(".")) if node.module else base
            yield from ((*origin, alias.name) for alias in node.names)


def test_every_part_is_known() -> None:
    parts = {Path(module).parts[0].removesuffix(".py") for module in modules()} - {"__init__"}
    assert parts == MAY_IMPORT.keys()


@pytest.mark.parametrize("module", [module for module in modules() if module != "__init__.py"])
def test_a_module_imports_only_what_comes_before_it(module: str) -> None:
    part = Path(module).parts[0].removesuffix(".py")
    allowed = {part} | MAY_IMPORT[part] | ({"web"} if module in SERVING else set())
    ours = {name[1] for name in imported(module) if name[0] == "app"}
    assert ours <= allowed


@pytest.mark.parametrize(
    "module", [m for m in modules() if not m.startswith(("web/", "benchmarks/")) and m != "__init__.py"]
)
def test_nothing_but_web_knows_http_or_makes_json_of_the_domain(module: str) -> None:
    names = set(imported(module))
    assert not {name[0] for name in names} & HTTP
    assert ("pydantic_core", "to_json") not in names
    declared = {
        node.name
        for node in ast.walk(ast.parse((APP / module).read_text("utf-8")))
        if isinstance(node, ast.ClassDef)
    }
    assert not {name for name in declared if name.endswith("Json")}
