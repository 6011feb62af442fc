"""A Chromium that does as told: its debugging protocol over two pipes, no library."""

import base64
import contextlib
import fcntl
import json
import os
import shutil
import signal
import time
from collections.abc import Iterator
from pathlib import Path

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
    None,
)
# What a loaded machine takes to start a browser, or to draw a page [s].
PATIENCE = 60.0


class Tab:
    """One page in a browser of its own.

    Args:
        sink: Where commands go.
        source: Where answers and events come from.
    """

    def __init__(self, sink: int, source: int) -> None:
        self._sink, self._source, self._buffer = sink, source, b""
        self._n, self._session = 0, None
        # Of scripts, and of the browser: refused by a policy, not found.
        self.complaints: list[str] = []
        self.addresses: list[str] = []
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        attached = self.send("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")

    def _read(self) -> dict:
        while b"\0" not in self._buffer:
            received = os.read(self._source, 1 << 16)
            assert received, "the browser is gone"
            self._buffer += received
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)

    def send(self, method: str, **params: object) -> dict:
        """Give a command and wait for what comes of it."""
        self._n += 1
        command = {"id": self._n, "method": method, "params": params}
        if self._session is not None:
            command["sessionId"] = self._session
        os.write(self._sink, json.dumps(command).encode() + b"\0")
        while (message := self._read()).get("id") != self._n:
            self._note(message)
        assert "error" not in message, message
        return message["result"]

    def _note(self, message: dict) -> None:
        told = message.get("params", {})
        match message.get("method"):
            case "Runtime.exceptionThrown":
                self.complaints.append(str(told["exceptionDetails"]))
            case "Runtime.consoleAPICalled" if told["type"] in ("error", "warning"):
                self.complaints.append(str([a.get("value") for a in told["args"]]))
            case "Log.entryAdded" if told["entry"]["level"] in ("error", "warning"):
                self.complaints.append(str(told["entry"]["text"]))
            case "Network.requestWillBeSent":
                self.addresses.append(told["request"]["url"])
            case "Network.webSocketCreated":
                self.addresses.append(told["url"])

    def run(self, script: str) -> object:
        """Value of an expression on the page."""
        done = self.send(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in done, done
        return done["result"].get("value")

    def until(self, script: str) -> object:
        """Wait for an expression to be true of the page, and return it."""
        end = time.monotonic() + PATIENCE
        while not (value := self.run(script)):
            assert time.monotonic() < end, script
            time.sleep(0.05)
        return value

    def show(
        self, address: str, *, width: int, height: int, dark: bool = False
    ) -> None:
        """Go to an address, on a screen of some size, by day or at night."""
        self.send(
            "Emulation.setDeviceMetricsOverride",
            **{"width": width, "height": height},
            **{"deviceScaleFactor": 1, "mobile": width < 600},
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.send("Emulation.setEmulatedMedia", features=[scheme])
        self.send("Page.navigate", url=address)

    def click(self, x: float, y: float, *, count: int = 1) -> None:
        """Press and release the left button."""
        for kind in ("mousePressed", "mouseReleased"):
            self.send(
                "Input.dispatchMouseEvent",
                **{"type": kind, "x": x, "y": y, "button": "left"},
                clickCount=count,
            )

    def type(self, text: str) -> None:
        """Type; a newline is the Enter key."""
        for letter in text:
            if letter != "\n":
                self.send("Input.insertText", text=letter)
                continue
            key = {"key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13}
            self.send("Input.dispatchKeyEvent", type="keyDown", text="\r", **key)
            self.send("Input.dispatchKeyEvent", type="keyUp", **key)

    def picture(self, path: Path) -> None:
        """Keep what the screen shows."""
        shot = self.send("Page.captureScreenshot", format="png")
        path.write_bytes(base64.b64decode(shot["data"]))


@contextlib.contextmanager
def chromium(profile: Path) -> Iterator[Tab]:
    """A browser that lasts as long as the block."""
    assert BROWSER is not None
    (read_in, write_in), (read_out, write_out) = os.pipe(), os.pipe()
    # Out of the way of 3 and 4, from which the browser reads and to which it writes.
    source, sink = (
        fcntl.fcntl(own, fcntl.F_DUPFD_CLOEXEC, 10) for own in (read_in, write_out)
    )
    # Not by subprocess, which would have to fork a process in which JAX has threads.
    browser = os.posix_spawn(
        BROWSER,
        [
            *(BROWSER, "--headless=new", "--no-sandbox", "--disable-gpu"),
            *("--hide-scrollbars", "--remote-debugging-pipe", "--no-first-run"),
            f"--user-data-dir={profile}",
        ],
        os.environ,
        file_actions=[
            (os.POSIX_SPAWN_DUP2, source, 3),
            (os.POSIX_SPAWN_DUP2, sink, 4),
            (os.POSIX_SPAWN_OPEN, 2, os.devnull, os.O_WRONLY, 0),
        ],
    )
    for own in (read_in, write_out, source, sink):
        os.close(own)
    try:
        yield Tab(write_in, read_out)
    finally:
        os.kill(browser, signal.SIGKILL)
        os.waitpid(browser, 0)
        os.close(write_in)
        os.close(read_out)
