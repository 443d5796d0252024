"""Connections that say nothing can not keep others out."""

from __future__ import annotations

import asyncio
from collections import OrderedDict

from uvicorn.protocols.http.h11_impl import H11Protocol

SILENT = 32  # connections without a whole request that are kept; a browser opens six to a host and uses them at once
SILENT_SECONDS = 15.0
LIMIT = 96  # of all connections: the silent ones and three times as many as a page needs for its pictures


def patient_protocol() -> type[H11Protocol]:
    """A protocol for one server whose connections without a request are closed: the oldest beyond SILENT, all in time.

    Uvicorn counts every connection against its limit, also those on which nothing was asked yet; sixty-four of them,
    opened and left, would answer everybody else with 503.
    """
    silent: OrderedDict[int, asyncio.BaseTransport] = OrderedDict()

    class Patient(H11Protocol):
        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            silent[id(self)] = transport
            while len(silent) > SILENT:
                _close(silent.popitem(last=False)[1])
            self.loop.call_later(SILENT_SECONDS, self._close_if_silent)

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if self.scope is not None:
                silent.pop(id(self), None)

        def connection_lost(self, exc: Exception | None) -> None:
            silent.pop(id(self), None)
            super().connection_lost(exc)

        def _close_if_silent(self) -> None:
            transport = silent.pop(id(self), None)
            if transport is not None:
                _close(transport)

    return Patient


def _close(transport: asyncio.BaseTransport) -> None:
    if not transport.is_closing():
        transport.close()
