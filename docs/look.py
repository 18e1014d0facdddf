"""`make docs-look`: every built page in headless Chromium, at two widths and in both themes.

Wanted: no page wider than its window, nothing cut off, no error on the console, no request that leaves the
folder. What is wrong is printed and counted; screenshots of pages written by hand are in target/look.
`python docs/look.py index guides` looks at these pages only. CHROMIUM= names the browser.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path
from typing import Any

from tornado.websocket import WebSocketClientConnection, websocket_connect

ROOT = Path(__file__).parents[1]
SITE, PICTURES = ROOT / "target" / "docs", ROOT / "target" / "look"
WIDTHS, THEMES = (1300, 390), ("light", "dark")
HEIGHT = 2000

# The page itself, then what scrolls or is cut inside it. Code, tables, formulas and pictures of cards may.
MEASURE = """(() => {
  const found = [], root = document.documentElement;
  const guilty = box => {
    const edge = box.getBoundingClientRect().right + 1;
    const past = [...box.querySelectorAll("*")].filter(e => e.getBoundingClientRect().right > edge);
    return past.filter(e => !e.closest("pre")).slice(-1).map(e => e.outerHTML.slice(0, 80));
  };
  if (root.scrollWidth > root.clientWidth) found.push(`page is ${root.scrollWidth} px wide`);
  for (const e of document.querySelectorAll("main *")) {
    const wide = e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1;
    const style = getComputedStyle(e);
    const may = style.overflowX === "visible" || style.textOverflow === "ellipsis";
    if (wide && !may && !e.closest("pre, .pst-scrollable-table-container, .formula, .sd-card"))
      found.push(`${e.className || e.tagName} holds ${e.scrollWidth} px in ${e.clientWidth}: ${guilty(e)}`);
  }
  for (const e of document.querySelectorAll("main img"))
    if (e.complete && !e.naturalWidth) found.push(`no picture ${e.src}`);
  return found;
})()"""


class Browser:
    """One tab, driven over the DevTools protocol."""

    def __init__(self, socket: WebSocketClientConnection) -> None:
        self.socket, self.number, self.wrong = socket, 0, []

    async def send(self, method: str, **params: Any) -> Any:
        """Call a method; events that come before its answer are looked at."""
        self.number += 1
        await self.socket.write_message(json.dumps({"id": self.number, "method": method, "params": params}))
        while (message := await self.read()).get("id") != self.number:
            pass
        return message.get("result")

    async def read(self) -> dict[str, Any]:
        message = json.loads(await self.socket.read_message())
        method, params = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.wrong.append(params["exceptionDetails"]["text"])
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.wrong.append(params["entry"]["text"])
        elif method == "Network.requestWillBeSent" and not params["request"]["url"].startswith(
            ("file:", "data:")
        ):
            self.wrong.append(f"request to {params['request']['url']}")
        return message

    async def open(self, page: Path, width: int) -> list[str]:
        """Load a page; what is wrong with it."""
        self.wrong = []
        size = {"width": width, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
        await self.send("Emulation.setDeviceMetricsOverride", **size)
        await self.send("Page.navigate", url=page.as_uri())
        while (await self.read()).get("method") != "Page.loadEventFired":
            pass
        measured = await self.send("Runtime.evaluate", expression=MEASURE, returnByValue=True)
        return self.wrong + measured["result"]["value"]

    async def picture(self, theme: str, file: Path) -> None:
        """A screenshot in a theme."""
        themed = f"document.documentElement.dataset.mode = document.documentElement.dataset.theme = '{theme}'"
        await self.send("Runtime.evaluate", expression=themed)
        file.parent.mkdir(parents=True, exist_ok=True)
        shot = await self.send("Page.captureScreenshot", format="png")
        file.write_bytes(base64.b64decode(shot["data"]))


@contextlib.asynccontextmanager
async def browser() -> Any:
    program = os.environ.get("CHROMIUM") or shutil.which("chromium")
    if program is None:
        raise SystemExit("chromium is not there: install it, or name it by CHROMIUM=")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        flags = ["--headless=new", "--no-sandbox", "--remote-debugging-port=0", f"--user-data-dir={folder}"]
        process = subprocess.Popen([program, *flags, "about:blank"], stderr=subprocess.DEVNULL)
        try:
            port_file = Path(folder) / "DevToolsActivePort"
            while not (port_file.exists() and (lines := port_file.read_text().splitlines())):
                await asyncio.sleep(0.1)
            with urllib.request.urlopen(f"http://127.0.0.1:{lines[0]}/json/list") as answer:
                tab = next(tab for tab in json.load(answer) if tab["type"] == "page")
            socket = await websocket_connect(tab["webSocketDebuggerUrl"], max_message_size=1 << 28)
            found = Browser(socket)
            for domain in ("Page", "Runtime", "Log", "Network"):
                await found.send(f"{domain}.enable")
            yield found
        finally:
            process.terminate()
            process.wait()


async def main(names: list[str]) -> int:
    written = [page for page in SITE.rglob("*.html") if "_static" not in page.parts]
    pages = [SITE / f"{name}.html" for name in names] or sorted(written)
    if missing := [str(page) for page in pages if not page.is_file()]:
        raise SystemExit(f"not built, or named otherwise: {', '.join(missing)}")
    wrong = 0
    async with browser() as tab:
        for width in WIDTHS:
            for page in pages:
                name = page.relative_to(SITE).with_suffix("")
                found = await tab.open(page, width)
                wrong += bool(found)
                for text in found:
                    print(f"{name} ({width} px): {text}")
                if names or not {"generated", "_modules"} & set(name.parts):
                    for theme in THEMES:
                        await tab.picture(theme, PICTURES / f"{width}-{theme}" / f"{name}.png")
    print(f"{len(pages)} pages at {len(WIDTHS)} widths: {wrong} views with something wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(asyncio.run(main(sys.argv[1:])))
