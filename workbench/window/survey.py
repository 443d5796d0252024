"""All images under the current parameters, in the background, so that a gain on one can not hide a loss on another."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from contextlib import suppress
from typing import Any

from workbench.compare import Comparison, summarise
from workbench.window.parameters import HashedConfig
from workbench.window.session import Session
from workbench.window.truth import statistics_json

KEPT_SETS = 6  # sets of parameters whose rows are kept: going back to one costs nothing
FIRST_SECONDS = 5.0  # the first picture goes before all background work
QUIET_SECONDS = 0.15  # after the last slider tick before background work goes on


class Survey:
    """A thread that processes every image for the parameters asked for last, then for the saved ones."""

    def __init__(self, session: Session) -> None:
        """The thread starts with the first `ask` and ends with the program."""
        self._session = session
        self._wake = threading.Condition()
        self._sets: OrderedDict[str, _Set] = OrderedDict()
        self._queue: list[_Set] = []
        self._thread: threading.Thread | None = None

    def ask(self, wanted: list[HashedConfig]) -> None:
        """Have these sets processed, the first one first; sets asked for earlier and not now are given up."""
        with self._wake:
            self._queue = [self._set(c) for c in wanted]
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="survey", daemon=True)
                self._thread.start()
            self._wake.notify()

    def _set(self, configuration: HashedConfig) -> _Set:
        one = self._sets.get(configuration.hash)
        if one is None or one.epoch != self.epoch:
            one = _Set(configuration, len(self._session.opened.pictures), self.epoch)
            self._sets[configuration.hash] = one
        self._sets.move_to_end(configuration.hash)
        while len(self._sets) > KEPT_SETS:
            self._sets.popitem(last=False)
        return one

    @property
    def epoch(self) -> int:
        """The engine's epoch that the rows belong to; rows of an earlier one are dropped."""
        return self._session.opened.engine.epoch

    def state(self, hash_: str, since: int) -> dict[str, Any]:
        """Progress of one set, its rows from number ``since`` on, and the statistics over what is done."""
        with self._wake:
            one = self._sets.get(hash_)
            if one is None:
                return {"hash": hash_, "done": 0, "total": len(self._session.opened.pictures), "rows": []}
            rows = one.rows[max(0, since) :]
            comparisons = list(one.comparisons)
        figures = statistics_json(summarise(comparisons)) if comparisons else None
        return {"hash": hash_, "done": len(one.rows), "total": one.total, "rows": rows, "statistics": figures}

    def _run(self) -> None:
        self._prepare()
        while True:
            one = self._next()
            while self._session.idle_for() < QUIET_SECONDS:
                time.sleep(0.02)
            if one is self._next():  # the parameters may have changed while waiting
                self._one_image(one)

    def _prepare(self) -> None:
        """The engine's slow first work; without it labels come from each image alone."""
        self._session.first_answer.wait(FIRST_SECONDS)
        prepare = self._session.opened.prepare
        if prepare is not None:
            with suppress(Exception):  # the images themselves will show what is wrong
                prepare()

    def _next(self) -> _Set:
        with self._wake:
            while True:
                for one in self._queue:
                    if len(one.rows) < one.total:
                        return one
                self._wake.wait()

    def _one_image(self, one: _Set) -> None:
        outcome = self._session.background_outcome(len(one.rows), one.configuration)
        row = self._session.row(outcome)
        row["candidates"] = sum(bool(c["reason"]) for c in row["candidates"])  # the number is enough here
        comparison = self._session.comparison(outcome)
        with self._wake:
            one.rows.append(row)
            if comparison is not None:
                one.comparisons.append(comparison)


class _Set:
    """One set of parameters and the rows that are done."""

    def __init__(self, configuration: HashedConfig, total: int, epoch: int) -> None:
        self.epoch = epoch
        self.configuration = configuration
        self.total = total
        self.rows: list[dict[str, Any]] = []
        self.comparisons: list[Comparison] = []
