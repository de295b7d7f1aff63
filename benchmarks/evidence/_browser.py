"""A page opened in headless Chromium: how wide it lies, its console, and what it asks of a network."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

HEIGHT = 900  # of the window [px]
_OWN = (
    "googleapis.com",
    "google.com",
    "gvt1.com",
    "gstatic.com",
)  # the browser itself asks them, page or not
_FONTS = "fonts."  # but these only for a page
_HERE = "127.0.0.1"
_RESULT = re.compile(r"<pre id=\"measure\">(.*?)</pre>", re.S)
_FRAME = """<!DOCTYPE html><html><body style="margin:0"><pre id="measure"></pre>
<iframe id="page" style="width:{width}px;height:{height}px;border:0" src="{page}"></iframe>
<script>
document.getElementById("page").onload = function () {{
  const page = this.contentDocument, root = page.documentElement, over = [];
  const scrolls = e => e && e !== root && e !== page.body &&
    (/auto|scroll/.test(getComputedStyle(e).overflowX) || scrolls(e.parentElement));
  for (const e of page.querySelectorAll("p,h1,h2,table,svg,figure,figcaption,li"))
    if (e.getBoundingClientRect().right > {width} + 1 && !scrolls(e) && !e.closest("nav"))
      over.push(e.tagName + " " + e.textContent.slice(0, 40));
  document.getElementById("measure").textContent = JSON.stringify({{
    width: root.scrollWidth, over: over.slice(0, 5), text: page.body.textContent.length,
    dark: this.contentWindow.matchMedia("(prefers-color-scheme: dark)").matches,
    paper: getComputedStyle(page.body).backgroundColor}});
}};
</script></body></html>"""


@dataclass(frozen=True, kw_only=True)
class Visit:
    """What came of opening a page.

    Attributes:
        width: that its content takes [px].
        over: elements that reach beyond the window.
        characters: of its text.
        dark: the page was asked for in dark.
        paper: colour of the background.
        console: lines of the console.
        requests: addresses on a network that were asked for.
    """

    width: int
    over: list[str]
    characters: int
    dark: bool
    paper: str
    console: list[str]
    requests: list[str]


def browser() -> str | None:
    """Return the program, or None."""
    return next(
        (
            found
            for name in ("chromium", "chromium-browser", "google-chrome")
            if (found := shutil.which(name))
        ),
        None,
    )


@contextmanager
def serve(folder: Path) -> Iterator[str]:
    """Serve a folder on this machine alone, and yield the address."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer((_HERE, 0), partial(Quiet, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://{_HERE}:{server.server_port}"
    server.shutdown()


def visit(program: str, page: Path, width: int, dark: bool, folder: Path, address: str) -> Visit:
    """Open a page in a frame as wide as asked; the browser's own windows are 500 px wide at least.

    Args:
        program: of `browser`.
        page: HTML file below the folder.
        width: of the frame [px].
        dark: prefer dark.
        folder: for the frame's own file and the browser's.
        address: at which the folder is served.

    Raises:
        RuntimeError: the browser says nothing of the page.
    """
    frame, net = folder / "frame.html", folder / "net.json"
    url = f"{address}/{page.relative_to(folder).as_posix()}"
    frame.write_text(_FRAME.format(width=width, height=HEIGHT, page=html.escape(url)))
    net.unlink(missing_ok=True)
    done = subprocess.run(
        [
            program,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            "--disable-component-update",
            "--no-first-run",
            "--enable-logging=stderr",
            f"--user-data-dir={folder / 'profile'}",
            f"--log-net-log={net}",
            f"--window-size={max(width, 500)},{HEIGHT}",
            f"--blink-settings=preferredColorScheme={0 if dark else 1}",
            "--virtual-time-budget=3000",
            "--dump-dom",
            f"{address}/frame.html?{time.monotonic_ns()}",  # else a frame written in the same second comes from the cache
        ],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    found = _RESULT.search(done.stdout)
    if found is None or not found[1]:
        raise RuntimeError(f"{page}: the browser measured nothing: {done.stderr[-300:]}")
    measure = json.loads(html.unescape(found[1]))
    addresses = set(
        re.findall(r'"url":\s*"((?:https?|wss?|ftp)://[^"]*)"', net.read_text() if net.exists() else "")
    )
    return Visit(
        width=measure["width"],
        over=measure["over"],
        characters=measure["text"],
        dark=measure["dark"],
        paper=measure["paper"],
        console=[line for line in done.stderr.splitlines() if "CONSOLE" in line],
        requests=sorted(a for a in addresses if _is_of_page(a.split("/")[2])),
    )


def _is_of_page(host: str) -> bool:
    """Return whether a page asked for a host, not the browser by itself, and not the folder's own server."""
    if host.startswith(_HERE):
        return False
    return host.startswith(_FONTS) or not any(own in host for own in _OWN)
