"""How settings declare a number."""

from typing import Any

from pydantic import Field


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
