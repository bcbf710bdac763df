"""The server: a page for whoever can reach this address, which by default is this machine alone."""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import os
import shutil
import signal
import socket
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING

from torchsynth.errors import InputError
from torchsynth.io import reason
from torchsynth.studio.running import end_all

if TYPE_CHECKING:
    import uvicorn

HOST = "127.0.0.1"
PORT = 7860
MOST_MEGABYTES = 20

_PORTS_TRIED = 100


def launch(
    host: str = HOST,
    port: int | None = None,
    *,
    browser: bool = False,
    max_upload: int = MOST_MEGABYTES,
    say: Callable[[str], None] = print,
) -> None:
    """Serve the studio until Ctrl-C, or until the process is asked to end in another way.

    Args:
        host: The address to listen at. Whoever can reach it can use the studio, and this machine's time.
        port: The port; None takes 7860, or the next one that is free.
        browser: Whether to open the page in the browser.
        max_upload: The largest file that can be uploaded, in megabytes.
        say: Told the address, once the page is ready.

    Raises:
        InputError: If gradio is missing, the port is taken, or there is no such address.
    """
    with _asked_to_end() as asked, serving(host, port, max_upload=max_upload) as address:
        say(f"The studio is ready at {address} (Ctrl-C ends it)")
        if not is_local(host):
            say(f"note: anyone who can reach {host} can use it")
        if browser:
            webbrowser.open(address)
        asked.wait()


@contextlib.contextmanager
def serving(host: str = HOST, port: int | None = None, *, max_upload: int = MOST_MEGABYTES) -> Iterator[str]:
    """Serve the studio while the block runs.

    Yields:
        The address of the page, which is ready.

    Raises:
        InputError: As for :func:`launch`.
    """
    if find_spec("gradio") is None:
        raise InputError(
            "studio", "needs gradio", "it is not installed", 'pip install "torchsynth-textures[studio]"'
        )
    if max_upload < 1:
        raise InputError("--max-upload", "must be at least 1 MB", f"it is {max_upload}", "allow more")
    with contextlib.closing(listening(host, port)) as listener, _own_folder():
        server = _server(max_upload)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        try:
            while not server.started and thread.is_alive():
                thread.join(0.01)
            taken = listener.getsockname()[1]
            yield f"http://{f'[{host}]' if ':' in host else host}:{taken}/"
        finally:
            end_all()
            logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)  # open pages are no error
            server.should_exit = True
            thread.join(5)


def listening(host: str, port: int | None) -> socket.socket:
    """A socket at an address.

    Args:
        host: The address.
        port: The port; None takes 7860, or the next one that is free; 0 any that is free.

    Raises:
        InputError: If the port is taken, or there is no such address.

    Example:
        >>> with listening("127.0.0.1", 0) as taken:
        ...     listening("127.0.0.1", taken.getsockname()[1])
        Traceback (most recent call last):
        torchsynth.errors.InputError: ...
    """
    ports = range(PORT, PORT + _PORTS_TRIED) if port is None else [port]
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    problem = OSError()
    for one in ports:
        found = socket.socket(family, socket.SOCK_STREAM)
        try:
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            found.bind((host, one))
            found.listen(128)
        except (OSError, OverflowError) as error:
            found.close()
            problem = error if isinstance(error, OSError) else OSError(0, "no such port")
        else:
            return found
    raise InputError(
        f"{host}:{ports[0]}", "must be a free address of this machine", reason(problem),
        "choose another --port, or leave it out" if port is not None else "choose a --port, or another --host",
    ) from None  # fmt: skip


def is_local(host: str) -> bool:
    """Whether an address leads to this machine alone.

    Example:
        >>> is_local("127.0.0.1"), is_local("localhost"), is_local("0.0.0.0")
        (True, True, False)
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _server(max_upload: int) -> uvicorn.Server:
    import uvicorn
    from fastapi import FastAPI

    from torchsynth.studio import form, look, page
    from torchsynth.studio.offline import Offline
    from torchsynth.studio.toolkit import gr

    app = gr.mount_gradio_app(
        FastAPI(openapi_url=None), page.build(), path="/", theme=look.theme(), css=look.CSS + form.CSS, footer_links=[],
        run_history=False, max_file_size=max_upload * 10**6, ssr_mode=False, pwa=False, show_error=True,
        enable_monitoring=False, mcp_server=False,
    )  # fmt: skip
    config = uvicorn.Config(
        Offline(app), log_level="warning", timeout_graceful_shutdown=1, ws="none", lifespan="on"
    )
    return uvicorn.Server(config)


@contextlib.contextmanager
def _own_folder() -> Iterator[None]:
    """Files of all visitors lie in one folder, which is removed in the end."""
    folder = tempfile.mkdtemp(prefix="torchsynth-studio-")
    before = os.environ.get("GRADIO_TEMP_DIR")
    os.environ["GRADIO_TEMP_DIR"] = folder
    try:
        yield
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if before is None:
            del os.environ["GRADIO_TEMP_DIR"]
        else:
            os.environ["GRADIO_TEMP_DIR"] = before


@contextlib.contextmanager
def _asked_to_end() -> Iterator[threading.Event]:
    """What is set when the process is asked to end: by Ctrl-C, by ``kill``, or because its terminal is closed.

    The handlers count even where a shell that started it in the background had Ctrl-C ignored.
    """
    asked = threading.Event()
    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), lambda *_: asked.set()) for name in names}
    try:
        yield asked
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)
