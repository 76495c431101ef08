"""Starts the evaluator (worker processes that simulate) in a thread, so that the API answers at once, and retries."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Literal

from wingfit.service.http import threads
from wingfit.service.jobs.runner import message
from wingfit.workers import RunningEvaluator
from wingfit.workers.share import lower_priority
from wingfit.workers.watch import Standing

LOG = logging.getLogger("wingfit.evaluator")
RETRY_SECONDS = (2.0, 5.0, 15.0, 60.0)
CLOSE_SECONDS = 5.0
NO_WORKER = (
    "there is no worker: of a Ray cluster all nodes that compute are gone, or its head does not answer; jobs are "
    "accepted, and wait until a node joins (ray start --address=...)"
)
Prepare = Callable[[Callable[[str], None], Callable[[], bool]], None]


class Pool:
    """Starts and holds the evaluator (worker processes that simulate), which all jobs share.

    ``prepare``, if given, runs before the first attempt, with a function to say what it does, and another that returns
    whether to stop. If it fails, the evaluator is started all the same.

    Attributes:
        error: why the last attempt to start the evaluator failed; None before the first failure and once it runs.
        doing: what the start does at present, for the user; None if nothing is to be said.
    """

    def __init__(
        self,
        make: Callable[[], RunningEvaluator],
        on_ready: Callable[[RunningEvaluator], None],
        prepare: Prepare | None = None,
    ) -> None:
        self._make, self._on_ready, self._prepare = make, on_ready, prepare
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._evaluator: RunningEvaluator | None = None
        self.error: str | None = None
        self.doing: str | None = None
        self._thread = threading.Thread(target=self._start, name="evaluator-start", daemon=True)

    def start(self) -> None:
        """Start the thread that starts the evaluator."""
        self._thread.start()

    @property
    def status(self) -> Literal["starting", "ok", "degraded"]:
        """Status for the health call: "degraded" if the evaluator cannot start or has no live worker."""
        if self._evaluator:
            return "degraded" if self.workers == 0 else "ok"
        return "degraded" if self.error else "starting"

    @property
    def detail(self) -> str | None:
        """Why no job is computed at present, for the user; None if no reason is known."""
        return NO_WORKER if self._evaluator and self.workers == 0 else self.error or self.doing

    @property
    def workers(self) -> int | None:
        """Number of live workers; None if it is unknown or the evaluator has not started."""
        standing = self.standing
        return standing.workers if standing else None

    @property
    def standing(self) -> Standing | None:
        """Numbers of live, dead and restarted workers; None before the evaluator has started."""
        evaluator = self._evaluator
        return evaluator.standing if evaluator else None

    def close(self, seconds: float = CLOSE_SECONDS) -> bool:
        """Close the evaluator, waiting at most ``seconds``; return whether it closed in that time."""
        self._stop.set()
        with self._lock:
            evaluator, self._evaluator = self._evaluator, None
        if evaluator is None:
            if self._thread.ident:  # the thread closes the evaluator that it is starting
                self._thread.join(seconds)
            return not self._thread.is_alive()
        return threads.done_within(seconds, "evaluator-close", evaluator.close)

    def _start(self) -> None:
        # Worker processes inherit the priority of the thread that starts them.
        lower_priority()
        attempt = 0
        self._prepare_start()
        while not self._stop.is_set():
            try:
                self._adopt(self._make())
                return
            except Exception as error:
                self.error = message(error)
                LOG.exception("cannot start the evaluator")
            self._stop.wait(RETRY_SECONDS[min(attempt, len(RETRY_SECONDS) - 1)])
            attempt += 1

    def _prepare_start(self) -> None:
        try:
            if self._prepare:
                self._prepare(self._say, self._stop.is_set)
        except Exception:
            LOG.exception("cannot prepare the start of the evaluator; it starts without")
        finally:
            self.doing = None

    def _say(self, doing: str) -> None:
        self.doing = doing

    def _adopt(self, evaluator: RunningEvaluator) -> None:
        with self._lock:
            if not self._stop.is_set():
                self._evaluator, self.error, self.doing = evaluator, None, None
        if self._stop.is_set():
            evaluator.close()
            return
        LOG.info("the evaluator is ready")
        self._on_ready(evaluator)
