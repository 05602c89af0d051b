"""Serves the page until a signal ends it."""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import os
import socket
import threading
import time
from collections.abc import Callable

import uvicorn

from rw_ekf.errors import BadInputError
from rw_ekf.page.server import Access, Place, page_app

_NICE = 10  # the run and its loop come first
_BACKLOG = 64
_LOOK_S = 0.05
_TICK_S = 0.2  # between two looks for a signal; uvicorn's own 0.1 s take 0.5 % of a core
# What a history (the first) and a curve are made with: 0.3 and 1.1 s of processor time to load, that the first page
# waited for. What only the curve needs comes later: it would be in the way of a first page that is opened at once.
_LOAD_AFTER_S = 2.0
_LOADED_AHEAD = ("rw_ekf.logs.reader", "rw_ekf.wheel.model_file", "rw_ekf.starting_point", "rw_ekf.filter.estimator")


def serve(place: Place, host: str, port: int, reported: Callable[[str], object]) -> None:
    """Serve runs or folders of runs; reported: the address, once it answers there. Raises BadInputError."""
    try:
        listening = _listening(host, port)
    except OSError as error:
        raise BadInputError(
            f"{host}:{port}: the page cannot be served there ({error.strerror or error}): give another HOST:PORT, or "
            "port 0 for any that is free"
        ) from None
    place.stopper.submit(os.getpid).result()  # its thread begins before the others are made to wait for the run
    os.nice(_NICE)  # on Linux of this thread, and of those and the processes that it starts
    threading.Thread(target=_load_ahead, name="load ahead", daemon=True).start()
    access = Access.of(host)
    shown = f"[{host}]" if ":" in host else host
    reported(f"http://{shown}:{listening.getsockname()[1]}/#token={access.token}")
    configuration = uvicorn.Config(
        page_app(place, access), log_level="error", access_log=False, lifespan="off",
        timeout_graceful_shutdown=1, limit_concurrency=1000,
    )  # fmt: skip
    try:
        _Server(configuration, place).run(sockets=[listening])
    finally:
        place.close()


def _load_ahead() -> None:
    """Before any request; a module that cannot be loaded is reported to who requests what it makes."""
    for number, name in enumerate(_LOADED_AHEAD):
        if number == 1:
            time.sleep(_LOAD_AFTER_S)
        with contextlib.suppress(Exception):
            importlib.import_module(name)


class _Server(uvicorn.Server):
    """One that a signal ends; not before who requested a stop has the answer: that ends the run, and so the page."""

    def __init__(self, configuration: uvicorn.Config, place: Place) -> None:
        super().__init__(configuration)
        self._place = place

    async def main_loop(self) -> None:
        """Serve until a signal, and until no stop is waited for."""
        ticks = 0  # of tenths of a second, as uvicorn counts them: at each tenth one it makes the date of its answers
        while not await self.on_tick(ticks):
            await asyncio.sleep(_TICK_S)
            ticks = (ticks + 2) % 10
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
