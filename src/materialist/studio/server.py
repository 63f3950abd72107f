"""Start and stop of the studio, and the requests that it refuses."""

from __future__ import annotations

import hmac
import ipaddress
import os
import shutil
import socket
import sys
import threading
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from materialist.errors import InputError, SetupError
from materialist.io.photo import PREFIX, example_path
from materialist.jobs.queue import JobQueue
from materialist.studio import SETTINGS, uploads
from materialist.studio.studio import LOCAL_PERSON, Studio
from materialist.studio.workspace import Project, WorkFolder

LOCAL = ("localhost", "127.0.0.1", "::1")
"""Names of this machine."""
Application = Callable[[Any, Any, Any], Awaitable[None]]


def check_host(host: str, password: str | None, everyone: bool) -> bool:
    """Whether `host` means this machine only. Raises InputError where others could come in unasked."""
    try:
        local = host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        local = False
    if not local and not password and not everyone:
        raise InputError(
            f"With --host {host} others can reach the studio: give --password WORD, or --open to let everybody in."
        )
    return local


def check_port(host: str, port: int) -> None:
    """Raises InputError where the port is no port, or is taken."""
    if not 1 <= port <= 65535:
        raise InputError(f"--port is a number from 1 to 65535, not {port}.")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise InputError(
                f"Port {port} on {host} cannot be used ({(error.strerror or str(error)).lower()}); give --port another."
            ) from error


def first_target(work: WorkFolder, target: str | None) -> Project | Path | None:
    """The target of the command: a scene package as a project, or a photo as a file. Raises InputError."""
    if target is None:
        return None
    path = Path(target)
    if (path / "scene.json").is_file():
        resolved = path.resolve()
        known = next((p for p in work.projects() if p.scene == resolved), None)
        return known or work.new(path.stem, LOCAL_PERSON, scene=resolved)
    photo = example_path(target) if target.startswith(PREFIX) else path
    if not photo.is_file():
        raise InputError(f"There is no photo and no scene package at {target}.")
    uploads.checked_picture(photo, photo.name)
    return photo


def serve(
    studio: Studio, *, host: str, port: int, password: str | None = None, on_ready: Callable[[str], None] | None = None,
    stop: threading.Event | None = None,
) -> None:  # fmt: skip
    """Show the studio until Ctrl-C, or until `stop` is set. `on_ready` gets the address once the page answers."""
    # No word to anyone, and uploads in the work folder: read by Gradio when it is imported.
    os.environ.update(GRADIO_ANALYTICS_ENABLED="False", HF_HUB_OFFLINE="1", GRADIO_TEMP_DIR=str(studio.work.cache))
    try:
        import gradio as gr
    except ImportError as error:
        raise SetupError(
            f"The studio needs one more package: {sys.executable} -m pip install 'gradio==6.31.*'"
        ) from error
    from materialist.studio.page import asset, build

    page = build(studio)
    page.queue(default_concurrency_limit=8, max_size=200)
    try:
        _, address, _ = page.launch(
            server_name=host, server_port=port, share=False, quiet=True, prevent_thread_lock=True, show_error=True,
            auth=_login(password), auth_message="Any name will do; the password counts.",
            max_file_size=f"{SETTINGS.upload_megabytes}mb", allowed_paths=[], theme=_theme(gr),
            css=asset("style.css"), app_kwargs={"middleware": [_host_check(studio, host)]},
            js=asset("page.js"), footer_links=[], ssr_mode=False, enable_monitoring=False, pwa=False, mcp_server=False,
        )  # fmt: skip
        if on_ready is not None:
            on_ready(str(address))
        while stop is None or not stop.wait(0.5):
            if stop is None:
                time.sleep(0.5)
    except KeyboardInterrupt:
        return
    finally:
        studio.jobs.close()
        page.close(verbose=False)
        shutil.rmtree(studio.work.cache, ignore_errors=True)


def new_studio(work: str | Path, *, single_user: bool, workers: int = 1, seed: int = 0, device: str = "auto") -> Studio:
    """A studio on a work folder. Raises OutputError where it cannot be written."""
    if not 1 <= workers <= 64:
        raise InputError(f"--workers is a number from 1 to 64, not {workers}.")
    return Studio(WorkFolder(work), JobQueue(workers), single_user, seed=seed, device=device)


def _login(password: str | None) -> Any:
    """The check of name and password, or None."""
    if not password:
        return None
    return lambda name, word: hmac.compare_digest(word.encode(), password.encode())


def _host_check(studio: Studio, host: str) -> Any:
    from starlette.middleware import Middleware

    return Middleware(HostCheck, names=names_of(host) if studio.single_user else None)


def _theme(gr: Any) -> Any:
    """Dark ink on light paper, with the fonts of the machine: nothing is fetched."""
    sans, mono = ["system-ui", "Segoe UI", "Roboto", "sans-serif"], ["ui-monospace", "Consolas", "monospace"]
    return gr.themes.Base(primary_hue="blue", neutral_hue="gray", font=sans, font_mono=mono).set(
        button_primary_background_fill="#1d4ed8", button_primary_background_fill_hover="#1e40af",
        button_primary_text_color="#ffffff", body_text_color="#16202e", body_text_color_subdued="#475467",
        block_label_text_color="#16202e", block_title_text_color="#16202e", button_cancel_background_fill="#b42318",
        button_cancel_text_color="#ffffff", slider_color="#1d4ed8",
    )  # fmt: skip


class HostCheck:
    """ASGI middleware that refuses requests sent by the pages of other sites.

    A browser sends `Origin` with what a page asks of another place; it must be the place that is asked. Where the
    studio serves this machine only, that place must have one of its names, too: a site that lets its own name point
    to 127.0.0.1 (DNS rebinding) is of the same origin, but not of ours.
    """

    def __init__(self, app: Application, names: tuple[str, ...] | None = None):
        """`names`: host names that may be asked for; None for all."""
        self.app, self.names = app, names

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on, or answer 403."""
        if scope["type"] not in ("http", "websocket") or self.allows(dict(scope["headers"])):
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            headers = [(b"content-type", b"text/plain; charset=utf-8")]
            await send({"type": "http.response.start", "status": 403, "headers": headers})
            await send({"type": "http.response.body", "body": b"The studio answers its own pages only.\n"})

    def allows(self, headers: dict[bytes, bytes]) -> bool:
        """Whether a request with these headers (names in lower case) may pass."""
        host = headers.get(b"host", b"").decode("latin-1").lower()
        if self.names is not None and _name(f"//{host}") not in self.names:
            return False
        origin = headers.get(b"origin", b"").decode("latin-1").lower()
        if not origin:
            return True
        # A proxy before the studio may ask it under another name, and tells the one that it was asked under.
        asked = {host, headers.get(b"x-forwarded-host", b"").decode("latin-1").lower()} - {""}
        scheme, place = origin.partition("://")[0], _place(origin)
        return place is not None and any(place == _place(f"{scheme}://{one}") for one in asked)


def names_of(host: str) -> tuple[str, ...]:
    """Host names of a studio that serves this machine only, bound to `host`."""
    return (*LOCAL, host.lower().strip("[]"))


def _name(address: str) -> str | None:
    try:
        return urlsplit(address).hostname
    except ValueError:
        return None


def _place(address: str) -> tuple[str, int | None] | None:
    """(host, port) of an address, the usual port of its scheme where it names none; None where it has no host."""
    try:
        parts = urlsplit(address)
        port = parts.port or {"http": 80, "https": 443}.get(parts.scheme)
    except ValueError:
        return None
    return (parts.hostname, port) if parts.hostname else None
