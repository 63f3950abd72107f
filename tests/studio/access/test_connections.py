"""Connections that ask for nothing do not shut others out."""

import socket
import threading

import pytest

pytest.importorskip("uvicorn", reason="needs the studio extra")
import uvicorn
from made_tasks import until
from starlette.responses import PlainTextResponse
from studio_server import free_port

from materialist.studio import StudioSettings
from materialist.studio.access import connections

REQUEST = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"


@pytest.fixture(params=[connections.Connection, connections.ProxiedConnection])
def port(request, monkeypatch):
    """Of a server that lets an address have three connections, and each be silent for half a second."""
    settings = StudioSettings(connections=3, request_seconds=0.5)
    monkeypatch.setattr(connections, "SETTINGS", settings)
    made = free_port()
    config = uvicorn.Config(
        PlainTextResponse("here"), "127.0.0.1", made, http=request.param, log_level="error"
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    until(lambda: server.started)
    yield made
    server.should_exit = True
    thread.join(5)
    assert not connections.Connection._open


def opened(port, sent=b"", address="127.0.0.1"):
    made = socket.create_connection(("127.0.0.1", port), source_address=(address, 0))
    made.settimeout(5)
    made.sendall(sent)
    return made


def is_answered(connection):
    try:
        return b"200 OK" in connection.recv(1000)
    except ConnectionResetError:
        return False


def test_a_connection_that_asks_for_nothing_is_closed(port):
    for sent in (b"", b"GET / HTTP/1.1\r\nX-A: "):
        assert opened(port, sent).recv(100) == b""
    # The second request never ends.
    slow = opened(port, REQUEST + REQUEST[:20])
    heard = b""
    while part := slow.recv(1000):
        heard += part
    assert heard.count(b"200 OK") == 1


def test_one_address_has_so_many_connections(port, request):
    held = [opened(port) for _ in range(3)]
    proxied = "Proxied" in request.node.name
    assert is_answered(opened(port, REQUEST)) is proxied
    assert is_answered(opened(port, REQUEST, "127.0.0.2"))
    for one in held:
        one.close()
    until(lambda: not connections.Connection._open)
    assert is_answered(opened(port, REQUEST))
