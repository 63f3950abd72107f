"""Who may talk to the studio, and what a browser may do with its answers."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

import pytest

pytest.importorskip("starlette", reason="needs the studio extra")
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route
from starlette.testclient import TestClient

from materialist.errors import InputError
from materialist.studio import StudioSettings
from materialist.studio.access import gate
from materialist.studio.access.gate import Gate
from materialist.studio.server import password_of

ALONE = "127.0.0.1"


def reader():
    """An application that reads the body of whatever is posted."""

    async def read(request):
        return PlainTextResponse(str(len(await request.body())))

    return Starlette(routes=[Route("/{path:path}", read, methods=["POST"])])


async def echo(scope, receive, send):
    """Says what it heard of proxies, and allows everything to everyone."""
    heard = [f"{k.decode()}={v.decode()}" for k, v in scope["headers"] if b"forwarded" in k]
    answer = PlainTextResponse(" ".join(heard), headers={"access-control-allow-origin": "*"})
    await answer(scope, receive, send)


def client(shared, base="http://studio.example", app=echo, address="1.2.3.4", **options):
    gate = Gate(app, shared, **options)
    return TestClient(gate, base_url=base, follow_redirects=False, client=(address, 1))


def headers(**values):
    return {name.replace("_", "-").encode(): value.encode() for name, value in values.items()}


@pytest.mark.parametrize(
    ("sent", "alone", "everyone", "behind"),
    [
        ({"host": "127.0.0.1:7860"}, True, True, False),
        ({"host": "localhost:7860", "origin": "http://localhost:7860"}, True, True, False),
        ({"host": "[::1]:7860", "origin": "http://[::1]:7860"}, True, True, False),
        ({"host": "evil.example"}, False, True, False),  # a name that was let point here
        ({"host": "evil.example", "origin": "http://evil.example"}, False, True, False),
        ({"host": "127.0.0.1:7860", "origin": "http://evil.example"}, False, False, False),
        ({"host": "127.0.0.1:7860", "origin": "http://127.0.0.1:9000"}, False, False, False),
        ({"host": "127.0.0.1:7860", "origin": "null"}, False, False, False),
        (
            {"host": "127.0.0.1:7860", "sec_fetch_site": "cross-site", "sec_fetch_mode": "no-cors"},
            False,
            False,
            False,
        ),
        (
            {
                "host": "127.0.0.1:7860",
                "sec_fetch_site": "cross-site",
                "sec_fetch_mode": "navigate",
            },
            True,
            True,
            False,
        ),
        ({"host": "studio.example", "origin": "https://studio.example"}, False, True, True),
        (
            {
                "host": "10.0.0.5:7860",
                "origin": "https://a.example",
                "x_forwarded_host": "a.example",
            },
            False,
            False,
            False,
        ),
        (
            {
                "host": "127.0.0.1:7860",
                "origin": "https://studio.example",
                "x_forwarded_host": "studio.example",
            },
            False,
            False,
            True,
        ),
        ({"host": "[broken", "origin": "http://[broken"}, False, False, False),
        ({}, False, True, False),
    ],
)
def test_welcome(shared, sent, alone, everyone, behind):
    assert Gate(echo, shared, host=ALONE).allows(headers(**sent)) is alone
    assert Gate(echo, shared).allows(headers(**sent)) is everyone
    assert Gate(echo, shared, proxy="studio.example").allows(headers(**sent)) is behind


def test_forwarded_headers_count_behind_a_proxy_only(shared):
    told = {
        "x-forwarded-host": "studio.example",
        "x-forwarded-for": "1.2.3.4",
        "forwarded": "host=evil.example",
    }
    assert client(shared).get("/", headers=told).text == ""
    page = client(shared, "http://10.0.0.5:7860", proxy="studio.example")
    assert (
        page.get("/", headers=told).text
        == "x-forwarded-host=studio.example x-forwarded-proto=https"
    )
    assert "Secure" in page.get("/", headers=told).headers["set-cookie"]
    assert page.get("/", headers={**told, "x-forwarded-host": "evil.example"}).status_code == 403
    assert page.get("/").status_code == 403


def test_no_preflight_of_another_site_is_answered(shared):
    asked = {"access-control-request-method": "POST", "origin": "http://evil.example"}
    answer = client(shared).options("/api/set", headers=asked)
    assert answer.status_code == 403 and "access-control-allow-origin" not in answer.headers


def test_every_answer_tells_the_browser_to_be_careful(shared):
    page = client(shared, password="word")
    for answer in (client(shared).get("/"), page.get("/"), client(shared, host=ALONE).get("/")):
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        assert answer.headers["x-content-type-options"] == "nosniff"


def test_sockets_are_closed_and_the_lifespan_passes(shared):
    reached = []
    sent = []

    async def app(scope, receive, send):
        reached.append(scope["type"])

    async def send(message):
        sent.append(message)

    for kind in ("websocket", "lifespan"):
        call = Gate(app, shared)({"type": kind, "path": "/api/state", "headers": []}, None, send)
        with ThreadPoolExecutor(
            1
        ) as thread:  # browser tests leave an event loop running in this one
            thread.submit(asyncio.run, call).result()
    assert reached == ["lifespan"] and sent == [{"type": "websocket.close", "code": 1008}]


def test_a_password_closes_every_door(shared, monkeypatch):
    monkeypatch.setattr(gate, "SETTINGS", StudioSettings(wrong_passwords=3))
    page = client(shared, password="open sesame ü")

    def enter(word):
        return page.post("/login", data={"password": word})

    for place in ("/", "/api/state", "/assets/a.js"):
        assert page.get(place).status_code == 401
    assert "password" in page.get("/").text and page.post("/api/upload").status_code == 401
    assert enter("x" * 5000).status_code == 413
    assert enter("wrong").status_code == 401 and page.get("/").status_code == 401
    answer = enter("open sesame ü")
    assert answer.status_code == 303 and "SameSite=Lax" in answer.headers["set-cookie"]
    assert "HttpOnly" in answer.headers["set-cookie"] and page.get("/api/state").status_code == 200
    other, elsewhere = (
        TestClient(page.app, follow_redirects=False, client=(address, 1))
        for address in ("1.2.3.4", "5.6.7.8")
    )
    assert other.get("/").status_code == 401
    for _ in range(2):
        assert other.post("/login", data={"password": "guess"}).status_code == 401
    right = {"password": "open sesame ü"}
    assert other.post("/login", data=right).status_code == 429  # not even the right one
    assert elsewhere.post("/login", data=right).status_code == 303  # others are not locked out
    assert page.get("/").status_code == 200


def test_the_password_need_not_be_an_argument(tmp_path, refused):
    (tmp_path / "word").write_text("open sesame\nsecond line\n")
    assert (
        password_of(None, tmp_path / "word") == "open sesame"
        and password_of("word", None) == "word"
    )
    (tmp_path / "none").write_text("\n")
    for word, file, message in (
        ("a", "word", "not both"),
        (None, "none", "empty"),
        (None, "no", "cannot be read"),
    ):
        with pytest.raises(InputError, match=message):
            password_of(word, tmp_path / file)
    assert "--password-file" in refused(
        "studio", "--behind-proxy", "studio.example", "--work", tmp_path / "w"
    )
    assert "HOST" in refused(
        "studio", "--behind-proxy", "http://x/y", "--open", "--work", tmp_path / "w"
    )


def test_bodies_are_counted_and_not_believed(shared, monkeypatch):
    monkeypatch.setattr(
        gate, "SETTINGS", StudioSettings(request_bytes=1000, upload_megabytes=0.001)
    )
    page, closed = (
        TestClient(Gate(reader(), shared, password=word), headers={gate.PAGE_HEADER: "a"})
        for word in (None, "open sesame")
    )

    def chunks(count):
        return iter([b"x" * 100] * count)

    for place, most in (("set", 10), ("upload", 20)):
        assert page.post(f"/api/{place}", content=chunks(most)).status_code == 200
        assert page.post(f"/api/{place}", content=chunks(most + 1)).status_code == 413
    assert closed.post("/login", content=chunks(50)).status_code == 413


@pytest.mark.parametrize(("path", "password"), [("/api/set", None), ("/login", "open sesame")])
def test_a_body_that_does_not_end_is_waited_for_a_while(shared, monkeypatch, path, password):
    monkeypatch.setattr(gate, "SETTINGS", StudioSettings(request_seconds=0.05))
    door = Gate(reader(), shared, password=password)
    scope = {"type": "http", "method": "POST", "path": path, "query_string": b""}
    scope["headers"] = [*headers(host="studio.example", x_materialist_page="a").items()]
    sent = []

    async def receive():
        await asyncio.sleep(0.01)
        return {"type": "http.request", "body": b"x", "more_body": True}

    async def send(message):
        sent.append(message)

    async def ask():
        await asyncio.wait_for(door(scope, receive, send), 5)

    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, ask()).result()
    assert sent[0]["status"] == 408
