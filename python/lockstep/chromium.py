# A headless Chromium that runs scripts. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import os
import select
import shutil
import subprocess
import tempfile
import weakref
from typing import Any, Optional

from .errors import UsageError

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# It shows nothing but pages of lockstep, so it needs no sandbox, which root and many containers lack. Pictures are
# computed: the same pixels on machines with and without a graphics card.
OPTIONS = ("--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking",
           "--disable-component-update", "--window-size=400,300", "--use-angle=swiftshader",
           "--enable-unsafe-swiftshader", "--remote-debugging-pipe")
PATIENCE = 120.0  # s, for an answer


def find_chromium() -> str:
    """The file that the environment variable CHROME names, else the first of NAMES on the PATH. Raises UsageError."""
    named = os.environ.get("CHROME")
    for name in (named,) if named else NAMES:
        if found := shutil.which(name):
            return found
    raise UsageError("pictures", f"need Chromium, and CHROME names none: {named!r}" if named else
                     "need Chromium, which is not on the PATH",
                     "install it (Debian: chromium), or set CHROME to the file of Chromium or Chrome", "usage")


class Chromium:
    """A process that lives until close() or the end of this object. It speaks the DevTools protocol over a pipe, so
    that nobody else can steer it: messages end with a zero byte."""

    def __init__(self) -> None:
        program = find_chromium()
        folder = tempfile.TemporaryDirectory(prefix="lockstep-chromium-", ignore_cleanup_errors=True)
        # Chromium reads from descriptor 3 and writes to 4.
        self._process = subprocess.Popen(
            ["/bin/sh", "-c", 'exec "$0" "$@" 3<&0 4>&1 </dev/null >&2', program, *OPTIONS,
             f"--user-data-dir={folder.name}", "about:blank"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self._end = weakref.finalize(self, _end, self._process, folder)
        self._count = 0
        self._rest = b""  # of what was read, behind the latest message
        self._session: Optional[str] = None
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]

    def run(self, script: str) -> Any:
        """The value of an expression of JavaScript in the page. Raises UsageError where it throws, or Chromium ends."""
        answer = self._call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if wrong := answer.get("exceptionDetails"):
            raise _failed(wrong.get("exception", {}).get("description", wrong["text"]))
        return answer["result"].get("value")

    def close(self) -> None:
        """Ends the process."""
        self._end()

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        if not self._end.alive:
            raise _failed("it was closed")
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        try:
            assert self._process.stdin
            self._process.stdin.write(json.dumps(message).encode() + b"\0")
            self._process.stdin.flush()
        except OSError as error:
            raise _failed(f"it has ended: {error}") from None
        while True:
            answer = json.loads(self._message())
            if answer.get("id") == self._count:  # all else are events
                if "error" in answer:
                    raise _failed(f"{method}: {answer['error']['message']}")
                result: dict[str, Any] = answer["result"]
                return result

    def _message(self) -> bytes:
        assert self._process.stdout
        parts = [self._rest]
        while b"\0" not in parts[-1]:
            if not select.select([self._process.stdout], [], [], PATIENCE)[0]:
                raise _failed(f"it gave no answer in {PATIENCE:.0f} s")
            parts.append(os.read(self._process.stdout.fileno(), 1 << 20))
            if not parts[-1]:
                raise _failed("it has ended")
        message, _, self._rest = b"".join(parts).partition(b"\0")
        return message


def _failed(why: str) -> UsageError:
    return UsageError("pictures", f"cannot be had of Chromium: {why}", "try CHROME=... with another Chromium or Chrome",
                      "usage")


def _end(process: "subprocess.Popen[bytes]", folder: "tempfile.TemporaryDirectory[str]") -> None:
    process.terminate()
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe:
            pipe.close()
    folder.cleanup()
