"""How settings declare a number, and how they show themselves."""

from inspect import signature
from typing import Any, TypeVar

from pydantic import Field

_Class = TypeVar("_Class", bound=type[object])


def number(low: float, high: float, unit: str, text: str) -> Any:
    """A finite number from low to high, with its unit and meaning, as JSON schema, page and command line show them."""
    return Field(ge=low, le=high, allow_inf_nan=False, description=text, json_schema_extra={"unit": unit})


def plainly(settings: _Class) -> _Class:
    """Names and defaults alone for the signature, with which `help` begins: with all bounds it fills a screen."""
    full = signature(settings)
    names = [parameter.replace(annotation=parameter.empty) for parameter in full.parameters.values()]
    setattr(settings, "__signature__", full.replace(parameters=names))  # noqa: B010  mypy knows no such attribute
    return settings
