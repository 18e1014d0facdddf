"""A headless Chromium, asked over its DevTools port what a page loads, says and measures."""

import json
import os
import shutil
import subprocess
import time
from contextlib import contextmanager

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
DEADLINE = 120  # s, for a machine that does much else


class Browser:
    """One tab; `events` are those since the last page was opened."""

    def __init__(self, socket):
        self.socket, self.count, self.session, self.events = socket, 0, None, []
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network", "Log", "Runtime"):
            self.ask(f"{domain}.enable")

    def ask(self, method, **params):
        self.count += 1
        message = {"id": self.count, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        self.socket.send(json.dumps(message))
        while True:
            answer = self._next()
            if answer.get("id") == self.count:
                assert "error" not in answer, answer
                return answer["result"]

    def _next(self):
        answer = json.loads(self.socket.recv(timeout=DEADLINE))
        if "method" in answer:
            self.events.append(answer)
        return answer

    def open(self, path, *, width, scheme):
        """Load a page at this width and colour scheme, to the end."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1,
                 mobile=False)  # fmt: skip
        self.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.events = []
        self.ask("Page.navigate", url=path.as_uri())
        while not any(event["method"] == "Page.loadEventFired" for event in self.events):
            self._next()

    def value(self, expression):
        return self.ask("Runtime.evaluate", expression=expression, returnByValue=True)["result"]["value"]

    def requests(self):
        """What was fetched from anywhere but the page's own text."""
        urls = [
            e["params"]["request"]["url"] for e in self.events if e["method"] == "Network.requestWillBeSent"
        ]
        return [url for url in urls if not url.startswith("data:")]

    def complaints(self):
        names = ("Log.entryAdded", "Runtime.exceptionThrown", "Runtime.consoleAPICalled")
        return [event["params"] for event in self.events if event["method"] in names]


@contextmanager
def browser(folder):
    """A Chromium with a profile in `folder`."""
    from websockets.sync.client import connect

    words = [CHROMIUM, "--headless=new", "--disable-gpu", "--no-first-run", "--disable-dev-shm-usage"]
    words += ["--remote-debugging-port=0", f"--user-data-dir={folder}"]
    if os.geteuid() == 0:
        words.append("--no-sandbox")
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        said, end = folder / "DevToolsActivePort", time.monotonic() + DEADLINE
        while not (said.exists() and said.read_text().count("\n") >= 1):
            assert process.poll() is None, f"chromium ended with {process.returncode}"
            assert time.monotonic() < end, "chromium did not open its port"
            time.sleep(0.1)
        port, place = said.read_text().split("\n")[:2]
        with connect(f"ws://127.0.0.1:{port}{place}", max_size=None, open_timeout=DEADLINE) as socket:
            yield Browser(socket)
    finally:
        process.terminate()
        process.wait(30)
