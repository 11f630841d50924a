"""Looks at rerun's page in a headless browser."""

import base64
import io
import json
import shutil
import time
import urllib.request
from contextlib import contextmanager, suppress

import numpy as np
from PIL import Image
from websockets.sync.client import connect

from swarm_mj.system.processes import running

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


def until(found, limit_s=60.0):
    """What a function finds, asked until it finds something."""
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        if answer := found():
            return answer
        time.sleep(0.2)
    raise AssertionError(f"nothing within {limit_s:g} s")


def page_of(said):
    """The page's address, once it is named and answers."""
    said.seek(0)
    for line in said.read().splitlines():
        if line.startswith("Open http"):
            address = line.split()[1]
            with suppress(OSError), urllib.request.urlopen(address, timeout=30) as page:
                return address if b"rerun" in page.read().lower() else None
    return None


def share_of(colour, picture):
    """The share of pixels of a colour, within what encoders change."""
    return np.mean(np.all(np.abs(picture - np.array(colour)) <= 2, axis=2))


@contextmanager
def browser(address, profile):
    """A headless Chromium that shows a page; it yields a function that takes its picture."""
    options = (
        *("--headless=new", "--no-sandbox", "--no-first-run", "--window-size=1600,1000"),
        *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
        *("--remote-debugging-port=0", f"--user-data-dir={profile}"),
        *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    )
    with (
        (profile / "said.txt").open("w") as said,
        running([CHROMIUM, *options, address], output=said),
    ):
        port = until(lambda: "".join(port_lines(profile)[:1]))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as pages:
            (page,) = [one for one in json.load(pages) if one["type"] == "page"]
        with connect(page["webSocketDebuggerUrl"], max_size=None, proxy=None) as socket:

            def screenshot():
                socket.send(json.dumps({"id": 1, "method": "Page.captureScreenshot"}))
                png = base64.b64decode(json.loads(socket.recv())["result"]["data"])
                return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=int)

            yield screenshot


def port_lines(profile):
    """The port that Chromium listens on, and more, once it does."""
    file = profile / "DevToolsActivePort"
    return file.read_text().splitlines() if file.exists() else []
