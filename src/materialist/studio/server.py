"""Start and stop of the studio, and what it refuses to do."""

from __future__ import annotations

import hmac
import ipaddress
import os
import shutil
import socket
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from materialist.errors import InputError, SetupError
from materialist.io.examples import PREFIX, example_path
from materialist.studio import uploads
from materialist.studio.hub import ALONE, Hub
from materialist.studio.jobs import Jobs
from materialist.studio.visitors import Guard, names_of
from materialist.studio.work import Project, WorkFolder


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
    """What the studio was started on: a scene package as a project, or a photo as a file. Raises InputError."""
    if target is None:
        return None
    path = Path(target)
    if (path / "scene.json").is_file():
        resolved = path.resolve()
        known = next((p for p in work.projects() if p.scene == resolved), None)
        return known or work.new(path.stem, ALONE, scene=resolved)
    photo = example_path(target) if target.startswith(PREFIX) else path
    if not photo.is_file():
        raise InputError(f"There is no photo and no scene package at {target}.")
    uploads.checked_picture(photo, photo.name)
    return photo


def serve(
    hub: Hub, *, host: str, port: int, password: str | None = None, told: Callable[[str], None] | None = None,
    stop: threading.Event | None = None,
) -> None:  # fmt: skip
    """Show the studio until Ctrl-C, or until `stop` is set. `told` gets the address once the page answers."""
    # No word to anyone, and uploads in the work folder: read by Gradio when it is imported.
    os.environ.update(GRADIO_ANALYTICS_ENABLED="False", HF_HUB_OFFLINE="1", GRADIO_TEMP_DIR=str(hub.work.cache))
    try:
        import gradio as gr
    except ImportError as error:
        raise SetupError(
            f"The studio needs one more package: {sys.executable} -m pip install 'gradio==6.31.*'"
        ) from error
    from materialist.studio.page import asset, build

    page = build(hub)
    page.queue(default_concurrency_limit=8, max_size=200)
    try:
        _, address, _ = page.launch(
            server_name=host, server_port=port, share=False, quiet=True, prevent_thread_lock=True, show_error=True,
            auth=_door(password), auth_message="Any name will do; the password counts.",
            max_file_size=f"{uploads.MAX_MEGABYTES}mb", allowed_paths=[], theme=_theme(gr),
            css=asset("style.css"), app_kwargs={"middleware": [_guard(hub, host)]},
            js=asset("page.js"), footer_links=[], ssr_mode=False, enable_monitoring=False, pwa=False, mcp_server=False,
        )  # fmt: skip
        if told is not None:
            told(str(address))
        while stop is None or not stop.wait(0.5):
            if stop is None:
                time.sleep(0.5)
    except KeyboardInterrupt:
        return
    finally:
        hub.jobs.close()
        page.close(verbose=False)
        shutil.rmtree(hub.work.cache, ignore_errors=True)


def new_hub(work: str | Path, *, alone: bool, workers: int = 1, seed: int = 0, device: str = "auto") -> Hub:
    """A hub on a work folder. Raises OutputError where it cannot be written."""
    if not 1 <= workers <= 64:
        raise InputError(f"--workers is a number from 1 to 64, not {workers}.")
    return Hub(WorkFolder(work), Jobs(workers, device), alone, seed=seed)


def _door(password: str | None) -> Any:
    """The check of name and password, or None."""
    if not password:
        return None
    return lambda name, word: hmac.compare_digest(word.encode(), password.encode())


def _guard(hub: Hub, host: str) -> Any:
    from starlette.middleware import Middleware

    return Middleware(Guard, names=names_of(host) if hub.alone else None)


def _theme(gr: Any) -> Any:
    """Dark ink on light paper, with the fonts of the machine: nothing is fetched."""
    sans, mono = ["system-ui", "Segoe UI", "Roboto", "sans-serif"], ["ui-monospace", "Consolas", "monospace"]
    return gr.themes.Base(primary_hue="blue", neutral_hue="gray", font=sans, font_mono=mono).set(
        button_primary_background_fill="#1d4ed8", button_primary_background_fill_hover="#1e40af",
        button_primary_text_color="#ffffff", body_text_color="#16202e", body_text_color_subdued="#475467",
        block_label_text_color="#16202e", block_title_text_color="#16202e", button_cancel_background_fill="#b42318",
        button_cancel_text_color="#ffffff", slider_color="#1d4ed8",
    )  # fmt: skip
