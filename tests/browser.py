"""A headless Chromium for the tests of pages: one page at a time, at a given width, light or dark.

Chromium is spoken to in the DevTools protocol through two pipes, so that it listens on no port.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium")
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--remote-debugging-pipe",
)  # fmt: skip
REFUSALS = """window.refused = [];
    document.addEventListener("securitypolicyviolation", event => refused.push([event.effectiveDirective, event.blockedURI]))"""
# True in a page whose charts are all drawn.
DRAWN = """(places => !places.length || window.Bokeh && Object.keys(Bokeh.index).length >= places.length)(
    document.querySelectorAll("[data-root-id]"))"""


class Browser:
    """One Chromium with a profile of its own, and one page in it."""

    def __enter__(self) -> Browser:
        assert CHROMIUM is not None
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        read, self._requests = os.pipe()
        self._answers, write = os.pipe()
        # Chromium reads file descriptor 3 and writes 4, whichever numbers the pipes have here.
        command = ["bash", "-c", f'exec "$@" 3<&{read} 4>&{write}', "", CHROMIUM, *OPTIONS, f"--user-data-dir={self._profile.name}"]
        self._process = subprocess.Popen(
            [*command, "about:blank"], pass_fds=(read, write), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(read)
        os.close(write)
        self._number, self._rest, self._session = 0, b"", ""
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self._call("Page.enable")
        self._call("Page.addScriptToEvaluateOnNewDocument", source=REFUSALS)
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.terminate()
        self._process.wait()
        os.close(self._requests)
        os.close(self._answers)
        self._profile.cleanup()

    def show(self, page: Path, width: int, scheme: str, settled: str = "true", fragment: str = "") -> None:
        """Load a page in a window ``width`` pixels wide, in the scheme "light" or "dark"; wait until ``settled`` holds in it.

        ``fragment`` is what its address ends with, as "#top".
        """
        # An address that differs in its fragment alone loads nothing, and a page with charts loads itself again in another scheme.
        self._call("Page.navigate", url="about:blank")
        self.until("location.href == 'about:blank'")
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 600)
        self._call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self._call("Page.navigate", url=page.resolve().as_uri() + fragment)
        self.until(f"location.href != 'about:blank' && document.readyState == 'complete' && ({settled})")

    def until(self, script: str) -> None:
        """Wait until an expression holds in the page, whatever it loads meanwhile."""
        started = time.monotonic()
        while time.monotonic() - started < 60:
            # A page that goes away in the middle leaves no answer.
            with contextlib.suppress(AssertionError):
                if self._call("Runtime.evaluate", expression=f"Boolean({script})", returnByValue=True)["result"].get("value") is True:
                    return
            time.sleep(0.05)
        raise TimeoutError(f"the page does not settle: {script}")

    def refusals(self) -> list[list[str]]:
        """Directive and source of everything that the policy of the page has refused so far."""
        return list(self.run("window.refused"))

    def press(self, key: str, code: int) -> None:
        """Press and release a key, by its name and its Windows key code."""
        for kind in ("rawKeyDown", "keyUp"):
            self._call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def run(self, script: str) -> Any:
        """The value of a JavaScript expression in the page, awaited where it is a promise."""
        found = self._call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        request = {"id": self._number, "method": method, "params": parameters}
        os.write(self._requests, json.dumps(request | ({"sessionId": self._session} if self._session else {})).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return dict(answer["result"])

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            more = os.read(self._answers, 1 << 20)
            assert more, "Chromium ended"
            self._rest += more
        message, _, self._rest = self._rest.partition(b"\0")
        return dict(json.loads(message))
