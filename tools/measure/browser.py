"""A headless Chromium that is clicked and typed at, over the two pipes of its DevTools protocol.

https://chromedevtools.github.io/devtools-protocol/ : messages of JSON, each ended by a zero byte, on descriptors 3 and
4 of the browser (--remote-debugging-pipe).
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
_ANSWERS_WITHIN_S = 60.0
_LOOKS_EVERY_S = 0.05
_LAUNCH = "import os, sys; [os.dup2(int(sys.argv[i]), 2 + i) for i in (1, 2)]; os.execv(sys.argv[3], sys.argv[3:])"
_MIDDLE = """(() => {
  const one = document.querySelector(%s); one.scrollIntoView({block: "center"});
  const box = one.getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2, box.width]; })()"""
_BEYOND_4 = 10  # descriptors that 3 and 4 do not overwrite


class Browser:
    """One page in it. `stated`: what the page wrote to its console, and errors that nobody caught."""

    def __init__(self, profile: Path, width: int = 1440, height: int = 1200) -> None:
        """profile: an empty folder of its own."""
        assert CHROMIUM is not None
        self.stated: list[str] = []
        self._rest = b""
        self._number = 0
        hears, self._writer = os.pipe()
        self._reader, says = os.pipe()
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, _BEYOND_4) for end in (hears, says)]
        words = [
            CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe",
            f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank",
        ]  # fmt: skip
        self._process = subprocess.Popen(
            [sys.executable, "-c", _LAUNCH, *map(str, ends), *words],
            pass_fds=ends, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        for end in (*ends, hears, says):
            os.close(end)
        self._session: str | None = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End it; what it still writes into its profile is over then."""
        self._session = None
        with contextlib.suppress(OSError, RuntimeError, TimeoutError):
            self.call("Browser.close")
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._writer)
        os.close(self._reader)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """What a method of the protocol answers. Raises RuntimeError for a refusal, TimeoutError for none."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._writer, json.dumps(message).encode() + b"\0")
        while (reported := self._next()).get("id") != self._number:
            self._hear(reported)
        if "error" in reported:
            raise RuntimeError(f"{method}: {reported['error']}")
        return dict(reported["result"])

    def open(self, address: str) -> None:
        """Go to an address; it may still be loading."""
        self.call("Page.navigate", url=address)

    def value(self, expression: str) -> Any:
        """What an expression of JavaScript comes to on the page. Raises RuntimeError where it throws."""
        reported = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in reported:
            raise RuntimeError(f"{expression}: {reported['exceptionDetails']}")
        return reported["result"].get("value")

    def until(self, expression: str) -> Any:
        """The first value of an expression that is true. Raises TimeoutError."""
        end_s = time.monotonic() + _ANSWERS_WITHIN_S
        while not (value := self.value(expression)):
            if time.monotonic() > end_s:
                raise TimeoutError(f"never true: {expression}; the page says {self.value('document.body.innerText')}")
            time.sleep(_LOOKS_EVERY_S)
        return value

    def click(self, selector: str) -> None:
        """Press the mouse on the middle of the first element of a CSS selector, where it can be seen."""
        x, y, wide = self.value(_MIDDLE % json.dumps(selector))
        if not wide:
            raise RuntimeError(f"{selector}: cannot be seen, and so not be clicked")
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def key(self, key: str) -> None:
        """Press a key, as DOM names it, on what has the focus."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            if not select.select([self._reader], [], [], _ANSWERS_WITHIN_S)[0]:
                raise TimeoutError("the browser does not answer")
            data = os.read(self._reader, 1 << 20)
            if not data:
                raise RuntimeError("the browser has ended")
            self._rest += data
        text, self._rest = self._rest.split(b"\0", 1)
        return dict(json.loads(text))

    def _hear(self, reported: dict[str, Any]) -> None:
        about = reported.get("params", {})
        if reported.get("method") == "Runtime.consoleAPICalled":
            self.stated.append(str([one.get("value", one.get("description")) for one in about["args"]]))
        elif reported.get("method") == "Runtime.exceptionThrown":
            self.stated.append(str(about["exceptionDetails"]))
        elif reported.get("method") == "Log.entryAdded":
            self.stated.append(str(about["entry"]["text"]))
