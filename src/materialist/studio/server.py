"""Start and stop of the studio."""

import ipaddress
import re
import shutil
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from materialist.errors import InputError
from materialist.io.photo import PREFIX, example_path
from materialist.jobs.queue import JobQueue
from materialist.memory import limit_heaps
from materialist.studio import SETTINGS, uploads
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
    page: Any,
    *,
    host: str,
    port: int,
    proxy: str | None = None,
    on_ready: Callable[[str], None],
) -> None:
    """Show a page, an ASGI application, until Ctrl-C. `on_ready` gets the address once it answers."""
    import uvicorn

    from materialist.studio.access.connections import Connection, ProxiedConnection

    # Of its forty threads each would keep freed memory: 100 MB after a photo.
    limit_heaps(2)
    # --- The server, which says nothing of itself and believes no proxy's headers ---
    config = uvicorn.Config(
        page,
        host,
        port,
        log_level="warning",
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=1,
        ws_max_size=SETTINGS.message_bytes,
        http=ProxiedConnection if proxy else Connection,
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
        studio.close()
        shutil.rmtree(studio.work.cache, ignore_errors=True)


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
        keeps_ready=True,
    )
