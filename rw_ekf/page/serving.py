"""Serves the page until a signal ends it."""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Callable

import uvicorn

from rw_ekf.errors import BadInputError
from rw_ekf.page.server import Access, Place, page_app

_NICE = 10  # the run and its loop come first
_BACKLOG = 64
_LOOK_S = 0.05


def serve(place: Place, host: str, port: int, told: Callable[[str], object]) -> None:
    """Serve runs or folders of runs; told: of the address, once it answers there. Raises BadInputError."""
    try:
        listening = _listening(host, port)
    except OSError as error:
        raise BadInputError(
            f"{host}:{port}: the page cannot be served there ({error.strerror or error}): give another HOST:PORT, or "
            "port 0 for any that is free"
        ) from None
    place.stopper.submit(os.getpid).result()  # its thread begins before the others are made to wait for the run
    os.nice(_NICE)  # on Linux of this thread, and of those and the processes that it starts
    access = Access.of(host)
    shown = f"[{host}]" if ":" in host else host
    told(f"http://{shown}:{listening.getsockname()[1]}/#token={access.token}")
    configuration = uvicorn.Config(
        page_app(place, access), log_level="error", access_log=False, lifespan="off",
        timeout_graceful_shutdown=1, limit_concurrency=1000,
    )  # fmt: skip
    try:
        _Server(configuration, place).run(sockets=[listening])
    finally:
        place.close()


class _Server(uvicorn.Server):
    """One that a signal ends; not before who asked for a stop has the answer: that ends the run, and so the page."""

    def __init__(self, configuration: uvicorn.Config, place: Place) -> None:
        super().__init__(configuration)
        self._place = place

    async def main_loop(self) -> None:
        """Serve until a signal, and until no stop is waited for."""
        await super().main_loop()
        while self._place.stopping:
            await asyncio.sleep(_LOOK_S)
        self._place.close()  # here, for behind this a signal ends the process at once


def _listening(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen(_BACKLOG)
    except OSError:
        listening.close()
        raise
    return listening
