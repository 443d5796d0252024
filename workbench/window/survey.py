"""All images under the current parameters, in the background, so that a gain on one can not hide a loss on another."""

from __future__ import annotations

import json
import threading
import time
from collections import OrderedDict
from contextlib import suppress
from typing import Any

from workbench.compare import Comparison, summarise
from workbench.window.parameters import HashedConfig
from workbench.window.profile_view import brief_stripe
from workbench.window.session import Session
from workbench.window.truth import statistics_json

KEPT_SETS = 6  # sets of parameters whose rows are kept: going back to one costs nothing
FIRST_SECONDS = 5.0  # the first picture goes before all background work
QUIET_SECONDS = 0.15  # after the last slider tick before background work goes on
LOOK_SECONDS = 2.0  # between two looks at whether files were written anew
AWAY_SECONDS = 30.0  # a page that has not asked for so long is closed: nothing is computed for it


class Survey:
    """A thread that processes every image for the parameters asked for last, then for the saved ones."""

    def __init__(self, session: Session) -> None:
        """The thread starts with the first `ask` and ends with the program."""
        self._session = session
        self._wake = threading.Condition()
        self._sets: OrderedDict[str, _Set] = OrderedDict()
        self._queue: list[_Set] = []
        self._thread: threading.Thread | None = None
        self._asked = 0.0
        self._closed = False

    def close(self) -> None:
        """End the thread: another folder was opened."""
        with self._wake:
            self._closed = True
            self._queue = []
            self._wake.notify()

    def ask(self, wanted: list[HashedConfig]) -> None:
        """Have these sets processed, the first one first; sets asked for earlier and not now are given up."""
        with self._wake:
            self._queue = [self._set(c) for c in wanted]
            self._asked = time.monotonic()
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="survey", daemon=True)
                self._thread.start()
            self._wake.notify()

    def _set(self, configuration: HashedConfig) -> _Set:
        one = self._sets.get(configuration.hash)
        if one is None or one.epoch != self.epoch:
            one = _Set(configuration, len(self._session.opened.pictures), self.epoch)
            self._sets[configuration.hash] = one
        one.grow(len(self._session.opened.pictures))
        self._sets.move_to_end(configuration.hash)
        while len(self._sets) > KEPT_SETS:
            self._sets.popitem(last=False)
        return one

    @property
    def epoch(self) -> int:
        """The engine's epoch that the rows belong to; rows of an earlier one are dropped."""
        return self._session.opened.engine.epoch

    def state(self, hash_: str, since: int) -> dict[str, Any]:
        """Progress of one set, the rows that came after the ``since``-th, and the statistics over what is done.

        A row comes again where its file was written anew; ``at`` is what to ask with as ``since`` the next time.
        """
        with self._wake:
            one = self._sets.get(hash_)
            if one is None:
                return {"hash": hash_, "done": 0, "total": len(self._session.opened.pictures), "rows": [], "at": 0}
            new, at = one.log[max(0, since) :], len(one.log)
            comparisons, done = list(one.comparisons.values()), len(one.stamps)
        rows = [json.loads(row) for row in new]
        figures = statistics_json(summarise(comparisons)) if comparisons else None
        return {"hash": hash_, "done": done, "total": one.total, "rows": rows, "at": at, "statistics": figures}

    def _run(self) -> None:
        self._prepare()
        while (one := self._next()) is not None:
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

    def _next(self) -> _Set | None:
        with self._wake:
            while True:
                if self._closed:
                    return None
                if time.monotonic() - self._asked > AWAY_SECONDS:
                    self._wake.wait()
                for one in self._queue:
                    if one.waiting:
                        return one
                self._wake.wait(LOOK_SECONDS)
                self._forget_overwritten()

    def _forget_overwritten(self) -> None:
        """Put the images whose files were written anew back into the queue."""
        for index in range(len(self._session.opened.pictures)):
            now = self._session.state_of(index)
            for one in self._queue:
                stamp = one.stamps.get(index)
                if stamp is not None and stamp != now:
                    one.waiting.append(index)
                    del one.stamps[index]
                    one.comparisons.pop(index, None)

    def _one_image(self, one: _Set) -> None:
        with self._wake:
            index = one.waiting.pop(0)
        outcome = self._session.background_outcome(index, one.configuration)
        row = json.dumps(_brief(self._session.row(outcome)), separators=(",", ":")).encode()
        comparison = self._session.comparison(outcome)
        with self._wake:
            one.stamps[index] = outcome.stamp
            one.log.append(row)
            if comparison is not None:
                one.comparisons[index] = comparison


def _brief(row: dict[str, Any]) -> dict[str, Any]:
    """What the overview of all images shows of one: ten thousand of them are kept."""
    spots = [{key: spot[key] for key in ("u", "v", "label", "flag", "peak", "cov")} for spot in row["spots"]]
    truth = row["truth"] and {"statistics": row["truth"]["statistics"]}
    rejected = sum(bool(c["reason"]) for c in row["candidates"])
    brief = row | {"spots": spots, "truth": truth, "candidates": rejected, "measures": []}
    if "stripe" not in row:
        return brief
    return brief | {"stripe": brief_stripe(row["stripe"]), "feature": None, "gap": None, "board": None}


class _Set:
    """One set of parameters: the images that wait, the stamps of those that are done, and their rows as they came.

    Rows are kept as the text that the page is sent: as objects, ten thousand of them would take ten times the memory.
    """

    def __init__(self, configuration: HashedConfig, total: int, epoch: int) -> None:
        self.epoch = epoch
        self.configuration = configuration
        self.total = total
        self.waiting = list(range(total))
        self.log: list[bytes] = []
        self.stamps: dict[int, str] = {}
        self.comparisons: dict[int, Comparison] = {}

    def grow(self, total: int) -> None:
        """Take in the images that came since."""
        self.waiting += range(self.total, total)
        self.total = total
