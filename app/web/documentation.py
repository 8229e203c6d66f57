"""The built documentation, or a page that says how to build it."""

from pathlib import Path

from fastapi.staticfiles import StaticFiles
from starlette.responses import HTMLResponse
from starlette.types import Receive, Scope, Send

_APP = Path(__file__).parents[1]
FOLDERS = (_APP / "documentation", _APP.parent / "docs" / "_build" / "html")  # wheel, source tree
MISSING = """<!doctype html><html lang="en"><meta charset="utf-8"><title>lidarcore: documentation</title>
<meta name="viewport" content="width=device-width"><meta name="color-scheme" content="light dark">
<style>body { max-width: 38rem; margin: 3rem auto; padding: 0 1rem; font: 16px/1.5 system-ui, sans-serif; }</style>
<h1>The documentation has not been built</h1>
<p>In the source tree, run <code>make docs</code> and reload this page. It needs no restart.</p>
<p>The same pages can be read as text in the folder <code>docs</code>. The <a href="../guide">guide</a> to the ellipses
and the <a href="../docs">reference of the REST API</a> are always there. <a href="../">Back to the dashboard</a></p>
"""


class Documentation:
    """An ASGI app that looks for the pages at every request, so that building them needs no restart."""

    def __init__(self, folders: tuple[Path, ...] = FOLDERS) -> None:
        """The first folder that holds an index.html is served."""
        self._folders = folders

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        folder = next((folder for folder in self._folders if (folder / "index.html").is_file()), None)
        app = HTMLResponse(MISSING, 404) if folder is None else StaticFiles(directory=folder, html=True)
        await app(scope, receive, send)
