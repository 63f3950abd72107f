"""Who may talk to the studio."""

import pytest

from materialist.studio.server import HostCheck, names_of

ALONE = names_of("127.0.0.1")


def headers(**values):
    return {name.replace("_", "-").encode(): value.encode() for name, value in values.items()}


@pytest.mark.parametrize(
    ("sent", "alone", "everyone"),
    [
        ({"host": "127.0.0.1:7860"}, True, True),
        ({"host": "localhost:7860", "origin": "http://localhost:7860"}, True, True),
        ({"host": "[::1]:7860", "origin": "http://[::1]:7860"}, True, True),
        ({"host": "evil.example"}, False, True),  # a name that was let point here
        ({"host": "evil.example", "origin": "http://evil.example"}, False, True),
        ({"host": "127.0.0.1:7860", "origin": "http://evil.example"}, False, False),
        ({"host": "127.0.0.1:7860", "origin": "http://127.0.0.1:9000"}, False, False),
        ({"host": "127.0.0.1:7860", "origin": "null"}, False, False),
        ({"host": "studio.example", "origin": "https://studio.example"}, False, True),
        ({"host": "10.0.0.5:7860", "origin": "https://a.example", "x_forwarded_host": "a.example"}, False, True),
        ({"host": "[broken", "origin": "http://[broken"}, False, False),
        ({}, False, True),
    ],
)
def test_welcome(sent, alone, everyone):
    assert HostCheck(None, ALONE).allows(headers(**sent)) is alone
    assert HostCheck(None, None).allows(headers(**sent)) is everyone


@pytest.mark.parametrize("kind", ["http", "websocket", "lifespan"])
def test_what_is_refused_goes_no_further(kind):
    reached, sent = [], []

    async def app(scope, receive, send):
        reached.append(scope["type"])

    async def send(message):
        sent.append(message)

    scope = {"type": kind, "headers": [(b"host", b"evil.example")]}
    with pytest.raises(StopIteration):  # nothing in it waits
        HostCheck(app, ALONE)(scope, None, send).send(None)
    assert reached == (["lifespan"] if kind == "lifespan" else [])
    if kind == "http":
        assert sent[0]["status"] == 403
    elif kind == "websocket":
        assert sent == [{"type": "websocket.close", "code": 1008}]
