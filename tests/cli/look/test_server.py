"""The page is served to this machine and to who knows the token, and to nobody else."""

import contextlib
import http.client
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from pushfit.data.simulate import write_recording
from tests.cli.look.makers import markup, recording


@contextlib.contextmanager
def looking(place: Path, *options: str, **environment: str):
    """The command as a user starts it, and the address that it prints."""
    with subprocess.Popen(
        [sys.executable, "-m", "pushfit", "look", "a.csv", "--no-browser", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=place,
        env=os.environ
        | {"PYTHONPATH": str(Path(__file__).parents[3]), "NO_COLOR": "1"}
        | environment,
    ) as process:
        try:
            assert process.stdout is not None
            yield process, process.stdout.readline().strip()
        finally:
            process.kill()


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    place = tmp_path_factory.mktemp("look")
    write_recording(recording(), place / "a.csv")
    return place


@pytest.fixture(scope="module")
def address(place):
    """A server under settings of Bokeh that would open it to everybody."""
    with looking(place, BOKEH_ALLOW_WS_ORIGIN="*", BOKEH_RESOURCES="cdn") as (
        _,
        address,
    ):
        yield address


def ask(address: str, path: str, **headers: str) -> tuple[int, str]:
    """Status and text of an answer."""
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=20)
    try:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        # The answer to a handshake has no end.
        text = "" if answer.status == 101 else answer.read().decode()
        return answer.status, text
    finally:
        connection.close()


def handshake(address: str, origin: str) -> int:
    """Status of the answer to a page of some origin that wants the socket."""
    headers = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Protocol": "bokeh, e30",
        "Origin": origin,
    }
    return ask(address, urlsplit(address).path + "/ws", **headers)[0]


def test_who_knows_the_token_gets_the_whole_page(address):
    status, text = ask(address, urlsplit(address).path)
    assert status == 200
    assert "pushfit look: a.csv" in text
    assert not re.findall(r"\b(?:src|href)=", markup(text))


@pytest.mark.parametrize("path", ["/", "/x", "/{short}", "/x/ws", "/x/autoload.js"])
def test_who_does_not_gets_nothing_not_even_the_token(address, path):
    token = urlsplit(address).path[1:]
    status, text = ask(address, path.format(short=token[:-1]))
    assert status == 404
    assert token not in text


def test_the_token_cannot_be_guessed(address):
    assert re.fullmatch(r"/[\w-]{43}", urlsplit(address).path)


def test_pages_of_other_origins_get_no_socket(address):
    parts = urlsplit(address)
    assert handshake(address, f"http://{parts.netloc}") == 101
    for origin in ("http://evil.example", f"http://localhost:{parts.port}"):
        assert handshake(address, origin) == 403


def test_other_machines_cannot_connect(address):
    port = urlsplit(address).port
    # All of 127 is this machine; a server for everybody would answer here.
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", port), timeout=5).close()


@pytest.mark.parametrize(
    ("number", "word"),
    [
        (signal.SIGINT, "interrupted"),
        pytest.param(signal.SIGTERM, "terminated", marks=pytest.mark.slow),
    ],
)
def test_it_ends_when_told(place, number, word):
    with looking(place) as (process, address):
        assert ask(address, urlsplit(address).path)[0] == 200
        process.send_signal(number)
        process.wait(timeout=20)
        assert process.returncode == 128 + number
        assert process.stderr is not None
        assert process.stderr.read().splitlines() == [
            "the page is on this machine only; Ctrl-C ends it",
            f"{word}; nothing was written",
        ]


@pytest.mark.slow
def test_a_port_that_is_taken_is_said(place, address):
    port = str(urlsplit(address).port)
    with looking(place, "--port", port) as (process, printed):
        assert process.wait(timeout=60) == 2
        assert printed == ""
        assert process.stderr is not None
        assert process.stderr.read().startswith(f"error: port {port}: Address already")
