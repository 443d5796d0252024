"""One long piece of work at a time, started by a click and looked at while it runs."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from geometry import PerceptronEmuError

Work = Callable[[Callable[..., None]], dict[str, Any]]


class Job:
    """Runs a function in a thread; its state is idle, running, done or failed."""

    def __init__(self) -> None:
        """Nothing has been started."""
        self._lock = threading.Lock()
        self._state: dict[str, Any] = {"state": "idle"}

    def start(self, hash_: str, work: Work) -> bool:
        """Start ``work``, which may tell what to add to the state meanwhile; False where something runs already."""
        with self._lock:
            if self._state["state"] == "running":
                return False
            self._state = {"state": "running", "hash": hash_}
        threading.Thread(target=self._run, args=(hash_, work), name="job", daemon=True).start()
        return True

    def state(self) -> dict[str, Any]:
        """The state, with the result where there is one."""
        with self._lock:
            return dict(self._state)

    def _tell(self, **more: Any) -> None:
        with self._lock:
            self._state = self._state | more

    def _run(self, hash_: str, work: Work) -> None:
        try:
            ended = {"state": "done", "hash": hash_, "result": work(self._tell)}
        except PerceptronEmuError as error:
            ended = {"state": "failed", "hash": hash_, "error": str(error)}
        except Exception as error:  # noqa: BLE001 - a fault in one job must not leave the page waiting for ever
            ended = {"state": "failed", "hash": hash_, "error": f"internal error: {type(error).__name__}: {error}"}
        with self._lock:
            self._state = ended
