"""How settings, and the numbers among them, are declared, and how they show themselves."""

from dataclasses import field
from inspect import signature
from typing import Any, TypeVar, dataclass_transform

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

T = TypeVar("T")


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
def settings(declared: type[T]) -> type[T]:
    """An immutable dataclass, given by keywords, that checks its values and refuses names it does not know."""
    return dataclass(config=ConfigDict(extra="forbid"), frozen=True, slots=True, kw_only=True)(declared)  # type: ignore[return-value]


def number(low: float, high: float, unit: str, text: str, *, default: Any = ...) -> Any:
    """A finite number from low to high, with its unit and meaning, as JSON schema, page and command line show them."""
    return Field(
        default,
        ge=low,
        le=high,
        allow_inf_nan=False,
        description=text,
        json_schema_extra={"unit": unit},
        kw_only=None if default is ... else True,  # for a default, pydantic does not heed the class's kw_only
    )


def whole(low: int, high: int, text: str, *, default: Any = ...) -> Any:
    """A whole number from low to high, with its meaning."""
    return Field(default, ge=low, le=high, description=text, kw_only=None if default is ... else True)


def plainly(settings: type[T]) -> type[T]:
    """Names and defaults alone for the signature, with which `help` begins: with all bounds it fills a screen."""
    full = signature(settings)
    names = [parameter.replace(annotation=parameter.empty) for parameter in full.parameters.values()]
    setattr(settings, "__signature__", full.replace(parameters=names))  # noqa: B010  mypy knows no such attribute
    return settings
