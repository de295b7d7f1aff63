"""The page of a fleet of 10,000 joints: its size, its start in a headless browser, no network, and a narrow screen.

Needs Chromium; ends with 2 where there is none.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from _common import Judge, parser
from _fleet_rows import FIRST, rows

from backdrive.fleet.drift import drifts
from backdrive.fleet.history import History
from backdrive.fleet.page import write_page

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")


class Browser:
    """A headless Chromium, asked by its remote protocol over a socket of our own."""

    def __init__(self, program: str, profile: str, width: int):
        self.process = subprocess.Popen(
            [program, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--remote-debugging-port=0",
             f"--user-data-dir={profile}", f"--window-size={width},844", "--disable-background-networking", "about:blank"],
            stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        assert self.process.stderr is not None
        address = next(line for line in self.process.stderr if "DevTools listening on" in line).split()[-1]
        threading.Thread(target=self.process.stderr.read, daemon=True).start()
        host, _, path = address.removeprefix("ws://").partition("/")
        name, _, port = host.partition(":")
        self.socket = socket.create_connection((name, int(port)), timeout=60)
        key = base64.b64encode(os.urandom(16)).decode()
        ask = f"GET /{path} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        self.socket.sendall(f"{ask}Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode())
        self.stream = self.socket.makefile("rb")
        while self.stream.readline().strip():
            pass
        self.number, self.events = 0, []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = None
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]

    session: str | None = None

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Ask, and return the answer; events on the way are kept."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        message |= {"sessionId": self.session} if self.session else {}
        data, mask = json.dumps(message).encode(), os.urandom(4)
        size = (
            bytes([0x80 | 126]) + len(data).to_bytes(2, "big")
            if len(data) > 125
            else bytes([0x80 | len(data)])
        )
        self.socket.sendall(b"\x81" + size + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(data)))
        while True:
            answer = json.loads(self.frame())
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(answer["error"])
                return answer["result"]
            self.events.append(answer)

    def frame(self) -> bytes:
        """Return the next message."""
        whole = b""
        while True:
            head = self.stream.read(2)
            size = head[1] & 127
            size = int.from_bytes(self.stream.read({126: 2, 127: 8}[size]), "big") if size > 125 else size
            whole += self.stream.read(size)
            if head[0] & 0x80:
                return whole

    def value(self, script: str) -> Any:
        """Return what a script in the page gives."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def close(self) -> None:
        """End it."""
        self.process.terminate()
        self.process.wait(20)


READY = "document.readyState === 'complete' && document.querySelectorAll('.card').length > 0"


def opened(judge: Judge, program: str, page: Path, width: int, folder: Path, joints: int) -> None:
    """Open the page and use it."""
    browser = Browser(program, str(folder / f"profile{width}"), width)
    try:
        browser.call("Network.enable")
        browser.call("Page.enable")
        browser.call("Runtime.enable")
        browser.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=844,
            deviceScaleFactor=1,
            mobile=width < 500,
        )
        begun = time.perf_counter()
        browser.call("Page.navigate", url=page.as_uri())
        while not browser.value(READY):
            if time.perf_counter() - begun > 60:
                break
            time.sleep(0.01)
        passed = time.perf_counter() - begun
        judge.at_most(f"{width} px: cards are drawn after [s] (load {os.getloadavg()[0]:.1f})", passed, 2.0)
        used = browser.value("performance.now()")
        print(f"  the page's own clock says {used / 1e3:.2f} s")
        wide = browser.value("document.documentElement.scrollWidth")
        judge.that(f"{width} px: content is {wide} px wide, nothing to scroll sideways", wide <= width)
        names = browser.value("[...document.querySelectorAll('.card b')].map(b => b.textContent)")
        judge.that(f"the worst comes first ({names[0]})", names[0].startswith("worst"))
        count = browser.value("document.querySelectorAll('.card').length")
        judge.that(f"only {count} cards are in the page", 0 < count < 400)
        browser.value("search.value = 'r0123'; search.dispatchEvent(new Event('input')); 1")
        hits = browser.value("[...document.querySelectorAll('.card b')].map(b => b.textContent)")
        judge.that(f"a search finds {len(hits)}: {hits[0]}", hits == ["r0123/j1"])
        browser.value("document.querySelector('.card').click(); 1")
        text = browser.value("document.getElementById('one').textContent")
        judge.that("a click opens the history", "r0123/j1" in text and "Friction at" in text)
        lines = browser.value("document.querySelectorAll('#one path').length")
        judge.that("with its picture", lines == 1)
        box = browser.value(
            "(r => [r.left, r.right])(document.getElementById('one').getBoundingClientRect())"
        )
        judge.that(f"that fits the screen ({box[0]:.0f} to {box[1]:.0f} px)", box[0] >= 0 and box[1] <= width)
        browser.value(
            "document.getElementById('one').close(); search.value=''; search.dispatchEvent(new Event('input')); 1"
        )
        browser.value(
            "window.scrollTo(0, 1e9); new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))"
        )
        last = browser.value("document.querySelectorAll('.card').length")
        judge.that(f"{last} cards at the end of the page", last > 0)
        outside = [
            e["params"]["request"]["url"]
            for e in browser.events
            if e.get("method") == "Network.requestWillBeSent"
            and not e["params"]["request"]["url"].startswith(("file:", "data:"))
        ]
        judge.that(f"{len(outside)} requests to a network", not outside)
        errors = [e for e in browser.events if e.get("method") == "Runtime.exceptionThrown"]
        judge.that(f"{len(errors)} errors of scripts", not errors)
        hostile = browser.value(
            "window.hostile === undefined && document.querySelectorAll('b img, main script').length === 0"
        )
        judge.that("a hostile name ran nothing", hostile)
    finally:
        browser.close()


def main() -> None:
    given = parser(__doc__).parse_args()
    program = next((path for name in NAMES if (path := shutil.which(name))), None)
    if program is None:
        print(f"no browser: none of {', '.join(NAMES)} is there (apt-get install chromium)")
        sys.exit(2)
    judge, joints = Judge(), 1000 if given.short else 10_000
    drawn = rows(20_260_101, joints, 0.02)
    day = FIRST + np.arange(drawn["constant"].shape[1], dtype=float)
    worst = int(np.argmax(drawn["ramps"]))
    drawn["constant"][worst] *= np.linspace(1.0, 3.0, day.size)
    histories = [
        History(
            robot="worst" if i == worst else "</script><img src=x onerror=hostile=1>" if i == 5 else f"r{i:04d}",
            type="", joint="j1", unit="rad", day=day, constant=c, viscous=v, temperature=T, speed=1.0, path=[f"/logs/{i}.npz"],
        )
        for i, (c, v, T) in enumerate(zip(drawn["constant"], drawn["viscous"], drawn["temperature"], strict=False))
    ]  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="fleet-") as scratch:
        page = Path(scratch) / "fleet.html"
        write_page(page, drifts(histories), sentences=[f"{joints} joints"])
        size = page.stat().st_size / 1e6
        judge.at_most(f"page of {joints} joints [MB]", size, 10.0 if not given.short else 1.0)
        judge.that(
            "no address of a network in it",
            b"http"
            not in page.read_bytes().replace(b"http-equiv", b"").replace(b"http://www.w3.org/2000/svg", b""),
        )
        for width in (1280, 390):
            opened(judge, program, page, width, Path(scratch), joints)
    judge.end()


if __name__ == "__main__":
    main()
