"""Start and stop of the studio."""

import ipaddress
import os
import re
import shutil
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from materialist.errors import InputError, SetupError
from materialist.install import extra_command
from materialist.io.photo import PREFIX, example_path
from materialist.jobs.queue import JobQueue
from materialist.studio import SETTINGS, asset, uploads
from materialist.studio.studio import LOCAL_PERSON, Studio
from materialist.studio.workspace import Project, WorkFolder


def check_host(host: str, password: str | None, everyone: bool, proxy: str | None = None) -> bool:
    """Whether `host` means this machine only. Raises InputError where others could come in unasked."""
    if proxy is not None and not re.fullmatch(r"([\w.-]+|\[[\da-fA-F:]+\])(:\d+)?", proxy):
        raise InputError(
            f"--behind-proxy takes the HOST or HOST:PORT that people ask for, not {proxy!r}."
        )
    try:
        # Behind a proxy everybody comes from this machine.
        local = proxy is None and (host == "localhost" or ipaddress.ip_address(host).is_loopback)
    except ValueError:
        local = False
    if not local and not password and not everyone:
        reached = f"--behind-proxy {proxy}" if proxy else f"--host {host}"
        raise InputError(
            f"With {reached} others can reach the studio: give --password-file FILE, or --open to let everybody in."
        )
    return local


def password_of(word: str | None, file: Path | None) -> str | None:
    """The password: the word that was given, or the first line of a file. Raises InputError."""
    if file is None:
        return word
    if word:
        raise InputError("Give --password or --password-file, not both.")
    try:
        with file.open(encoding="utf-8") as lines:
            password = lines.readline().strip()
    except (OSError, ValueError) as error:
        raise InputError(f"The password file {file} cannot be read: {error}.") from error
    if not password:
        raise InputError(
            f"The password file {file} has an empty first line; write the password there."
        )
    return password


def check_port(host: str, port: int) -> None:
    """Raises InputError where the port is taken."""
    # Bound once and released: the error comes before anything is loaded.
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise InputError(
                f"Port {port} on {host} cannot be used ({(error.strerror or str(error)).lower()}); give --port another."
            ) from error


def checked_target(target: str) -> Path:
    """The target of the command: a scene package or a photo. Raises InputError."""
    path = example_path(target) if target.startswith(PREFIX) else Path(target)
    if not (path / "scene.json").is_file():
        if not path.is_file():
            raise InputError(f"There is no photo and no scene package at {target}.")
        uploads.checked_picture(path)
    return path


def first_shown(work: WorkFolder, path: Path) -> Project | Path:
    """A scene package as a project; a photo as it is."""
    scene = path.resolve()
    # Opened before: its edits are there.
    known = next((p for p in work.projects() if p.scene == scene), None)
    return path if path.is_file() else known or work.new(path.stem, LOCAL_PERSON, scene=scene)


def serve(
    studio: Studio,
    *,
    host: str,
    port: int,
    password: str | None = None,
    proxy: str | None = None,
    on_ready: Callable[[str], None],
    page: Callable[..., Any] | None = None,
) -> None:
    """Show the studio until Ctrl-C. `on_ready` gets the address once the page answers.

    page: makes the page behind its gate, as `application` does, whose page it is by default.
    """
    build = page or application
    gate = build(studio, host=host, port=port, password=password, proxy=proxy)
    import uvicorn

    config = uvicorn.Config(
        gate,
        host,
        port,
        log_level="warning",
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=1,
    )
    server = uvicorn.Server(config)
    # A thread of its own: signals are for the command.
    thread = threading.Thread(target=server.run, name="server", daemon=True)
    try:
        thread.start()
        # --- Wait until it answers, then until it is told to end ---
        while not server.started and thread.is_alive():
            time.sleep(0.01)
        if server.started:
            name = (
                "localhost" if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
            )
            on_ready(f"https://{proxy}/" if proxy else f"http://{name}:{port}/")
        thread.join()
    except KeyboardInterrupt:
        return
    finally:
        # Jobs first: they would run on without anyone.
        studio.jobs.close()
        server.should_exit = True
        thread.join(3)
        shutil.rmtree(studio.work.cache, ignore_errors=True)


def application(
    studio: Studio,
    *,
    host: str,
    port: int,
    password: str | None = None,
    proxy: str | None = None,
) -> Any:
    """The page behind its gate, an ASGI application. Raises SetupError where Gradio is not installed."""
    studio.work.sweep()
    # No word to anyone, and uploads in the work folder: read by Gradio when it is imported.
    os.environ.update(
        GRADIO_ANALYTICS_ENABLED="False", HF_HUB_OFFLINE="1", GRADIO_TEMP_DIR=str(studio.work.cache)
    )
    try:
        import gradio as gr
    except ImportError as error:
        raise SetupError(f"The studio needs one more package: {extra_command('studio')}") from error
    from fastapi import FastAPI

    from materialist.studio.access.gate import Gate
    from materialist.studio.page import build

    page = build(studio)
    # Gradio has put pictures of the page itself into the cache: they stay.
    studio.work.kept |= {*studio.work.cache.iterdir()}
    _fetch_nothing()
    page.queue(default_concurrency_limit=8, max_size=200)
    app = gr.mount_gradio_app(
        FastAPI(openapi_url=None),
        page,
        "/",
        footer_links=[],
        show_error=True,
        allowed_paths=[],
        ssr_mode=False,
        max_file_size=f"{SETTINGS.upload_megabytes}mb",
        theme=_theme(gr),
        css=asset("style.css"),
        js=asset("page.js"),
        enable_monitoring=False,
        pwa=False,
        mcp_server=False,
        run_history=False,
    )
    single = host if studio.single_user else None
    return Gate(app, studio, host=single, proxy=proxy, password=password, port=port)


def _fetch_nothing() -> None:
    """Let Gradio open no address that a request names in place of a file."""
    from gradio import processing_utils as fetching

    async def refused(url: str, *_: Any, **options: Any) -> Any:
        raise InputError(
            f"The studio fetches nothing from other machines, so not {url[:100]} either; upload the file."
        )

    fetching.async_ssrf_protected_get = fetching.async_ssrf_protected_download = refused  # type: ignore[assignment]


def new_studio(
    work: str | Path, *, single_user: bool, workers: int = 1, seed: int = 0, device: str = "auto"
) -> Studio:
    """A studio on a work folder. Raises OutputError where it cannot be written."""
    return Studio(
        WorkFolder(work),
        JobQueue(workers, SETTINGS.job_memory, SETTINGS.job_seconds),
        single_user,
        seed=seed,
        device=device,
    )


def _theme(gr: Any) -> Any:
    """Dark ink on light paper, or the other way, with the fonts of the machine: nothing is fetched."""
    sans = ["system-ui", "Segoe UI", "Roboto", "sans-serif"]
    mono = ["ui-monospace", "Consolas", "monospace"]
    return gr.themes.Base(primary_hue="blue", neutral_hue="gray", font=sans, font_mono=mono).set(
        button_primary_background_fill="#1d4ed8",
        button_primary_background_fill_hover="#1e40af",
        button_primary_text_color="#ffffff",
        body_text_color="#16202e",
        body_text_color_subdued="#475467",
        block_label_text_color="#16202e",
        block_title_text_color="#16202e",
        button_cancel_background_fill="#b42318",
        button_cancel_text_color="#ffffff",
        slider_color="#1d4ed8",
        body_background_fill="#f6f7f9",
        border_color_primary="#d5dae2",
        link_text_color="#1d4ed8",
        link_text_color_dark="#93b4ff",
        error_text_color="#8f1d14",
        error_text_color_dark="#ff9d94",
    )
