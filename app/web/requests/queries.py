"""Queries: a parameter that a route does not have would do nothing, and is refused."""

from collections.abc import Iterator

from fastapi.dependencies.models import Dependant
from fastapi.exceptions import RequestValidationError
from starlette.requests import HTTPConnection


async def check_query(connection: HTTPConnection) -> None:
    """Raises RequestValidationError if a parameter is none of the route's.

    WebSockets pass: their refusal could not say why.
    """
    if connection.scope["type"] != "http":
        return
    known = sorted(_parameters(connection.scope["route"].dependant))
    there = f"there is {', '.join(known)}" if known else "there is none"
    wrong = [
        {"loc": ("query", name), "type": "no_parameter", "msg": f"There is no such parameter; {there}."}
        for name in connection.query_params
        if name not in known
    ]
    if wrong:
        raise RequestValidationError(wrong)


def _parameters(dependant: Dependant) -> Iterator[str]:
    yield from (field.alias for field in dependant.query_params)
    for needed in dependant.dependencies:
        yield from _parameters(needed)
