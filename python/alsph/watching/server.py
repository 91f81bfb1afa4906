"""The server of the page, for this machine alone: it reads, and answers nothing but GET and HEAD."""

import hashlib
import os
import platform
import re
import socketserver
import sys
import webbrowser
from base64 import b64encode
from contextlib import suppress
from http.server import BaseHTTPRequestHandler
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from alsph.errors import AlsphError, ConfigError, RunFolderError
from alsph.folder.run_folder import MARKS
from alsph.text import printable
from alsph.watching.watched import Watched

HOST = "127.0.0.1"
NAMES = (HOST, "localhost", "::1")
"""What a browser may call this machine: a page from elsewhere whose name was turned to this address is refused."""
PORTS = range(8000, 8100)
PATIENCE_SECONDS = 60.0
JSON = "application/json"


def page() -> bytes:
    """Return the page."""
    return files("alsph.watching").joinpath("page.html").read_bytes()


def policy(html: bytes) -> str:
    """Return what a browser may do for a page: run its own script, and nothing that came in with a text."""
    script = re.search(rb"<script>(.*?)</script>", html, re.S)
    own = b64encode(hashlib.sha256(script[1] if script else b"").digest()).decode()
    return (
        "default-src 'none'; connect-src 'self'; img-src 'self' data:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{own}'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


class Server(socketserver.ThreadingTCPServer):
    """Answers what the page of a run asks for."""

    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, port: int, watched: Watched) -> None:
        self.watched, self.page = watched, page()
        self.policy = policy(self.page)
        super().__init__((HOST, port), Handler)

    @property
    def port(self) -> int:
        """The port that it listens on."""
        return int(self.server_address[1])

    def content(self, path: str, query: dict[str, str]) -> tuple[str, bytes] | None:
        """Return kind and content of what is at a path, None if there is no such thing."""
        match path:
            case "/":
                return "text/html; charset=utf-8", self.page
            case "/state":
                return JSON, self.watched.state()
            case "/results":
                return JSON, self.watched.results()
            case "/picture":
                asked = (query.get(name, "") for name in ("field", "width", "ink"))
                return "image/png", self.watched.picture(*asked)
            case "/figure":
                return self.watched.figure(query.get("name", ""))
        return None

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Let those who have gone away go."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """One connection."""

    protocol_version = "HTTP/1.1"
    server_version, sys_version = "alsph", ""
    timeout = PATIENCE_SECONDS
    server: Server

    def do_GET(self) -> None:
        """Answer."""
        kind = "text/plain; charset=utf-8"
        if not self._is_for_this_machine():
            self._send(403, kind, f"open http://{HOST}:{self.server.port}/ or http://localhost\n".encode())
            return
        try:
            url = urlsplit(self.path)
            found = self.server.content(url.path, dict(parse_qsl(url.query)))
        except (AlsphError, OSError) as error:
            self._send(404, kind, printable(str(error)).encode())
        except Exception as error:  # code of the user's in a case
            self._send(500, kind, printable(f"{type(error).__name__}: {error}").encode())
        else:
            self._send(*((200, *found) if found else (404, kind, b"no such page\n")))

    do_HEAD = do_GET

    def _is_for_this_machine(self) -> bool:
        with suppress(ValueError):
            return urlsplit(f"//{self.headers.get('Host', '')}").hostname in NAMES
        return False

    def _send(self, status: int, kind: str, content: bytes) -> None:
        tag = f'"{hashlib.sha256(content).hexdigest()[:32]}"'
        if status == 200 and tag in self.headers.get("If-None-Match", ""):
            status, content = 304, b""
        self.send_response(status)
        for name, value in {
            "Content-Type": kind,
            "Content-Length": str(len(content)),
            "Cache-Control": "no-cache",
            "ETag": tag,
            "Content-Security-Policy": self.server.policy,
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
        }.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing of each request."""


def serve(path: str | Path, port: int | None = None) -> Server:
    """Return a server of the page of a run that listens, but does not answer yet (arguments as of `watch`)."""
    path = Path(path)
    if not path.is_dir():
        raise RunFolderError(f"{path}: no such run folder")
    if not any((path / name).exists() for name in MARKS):
        raise RunFolderError(f"{path}: not a run folder, it has no {' or '.join(MARKS)}")
    watched, reason = Watched(path), ""
    for candidate in PORTS if port is None else [port]:
        try:
            return Server(candidate, watched)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
    which = f"ports {PORTS[0]} to {PORTS[-1]}" if port is None else f"port {port}"
    raise ConfigError(f"{which}: cannot be had ({reason}); give another one, such as --port {PORTS[-1] + 1}")


def watch(path: str | Path, port: int | None = None, *, browser: bool = True) -> None:
    """Show a run, going on or ended, on a page in a browser, until Ctrl-C.

    The page is served on this machine alone, and reads the run folder without changing or holding anything in it.

    Parameters
    ----------
    path : path
        The run folder.
    port : int, optional
        The port; the first one from 8000 on that is free, if None.
    browser : bool
        Open the page, where there is a screen.

    Raises
    ------
    RunFolderError
        If it is no run folder.
    ConfigError
        If the port cannot be had.
    """
    with suppress(KeyboardInterrupt), serve(path, port) as server:
        address = f"http://{HOST}:{server.port}/"
        print(f"{address} shows {printable(str(path))}; Ctrl-C ends", flush=True)
        if "SSH_CONNECTION" in os.environ:
            tunnel = f"ssh -L {server.port}:localhost:{server.port} {platform.node()}"
            print(f"from where you sit: {tunnel}, then open {address}", flush=True)
        if browser and _has_screen():
            webbrowser.open(address)
        server.serve_forever()


def _has_screen() -> bool:
    """Whether a browser would open in a window, and not take the terminal."""
    return sys.platform in ("darwin", "win32") or any(name in os.environ for name in ("DISPLAY", "WAYLAND_DISPLAY"))
