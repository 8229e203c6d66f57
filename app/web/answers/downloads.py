"""Answers that a browser saves under a name that tells what they are."""

from urllib.parse import quote

from starlette.responses import Response

from ..openapi import MEDIA_TYPES


def file_of(content: str | bytes, format: str, stem: str) -> Response:
    """Content in a format of MEDIA_TYPES, named as files of a map are: hall-walls.csv."""
    name = f"{stem}.{format}"
    plain = f'filename="{name}"' if quote(name) == name else f"filename*=utf-8''{quote(name)}"
    headers = {"Content-Disposition": f"attachment; {plain}"}
    return Response(content, media_type=MEDIA_TYPES[format], headers=headers)
