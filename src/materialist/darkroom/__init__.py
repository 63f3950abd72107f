"""The darkroom: a full-window page for the studio, its server and its built client (`static`, from `web/`).

The server (`app`, behind the gate of `studio.access`) turns requests with checked bodies into calls of a
`studio.session.Session`. What a page shows is one JSON object (`state`); a websocket (`channel`) tells it when that has
changed, and how far jobs are. A `desk` holds what a page needs beside its session. Queue, limits, files and work
folder are the studio's.
"""

from materialist.errors import SetupError
from materialist.install import extra_command


def require_packages() -> None:
    """Raise SetupError where the studio extra is not installed."""
    try:
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
        import websockets  # noqa: F401
        from pydantic import BaseModel  # noqa: F401
    except ImportError as error:
        raise SetupError(f"The studio needs one more package: {extra_command('studio')}") from error
