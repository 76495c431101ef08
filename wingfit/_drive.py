"""Simulates the rig of a job on a server: takes simulations over HTTP, computes them here, returns the results."""

from __future__ import annotations

import tempfile
import threading
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np

from wingfit.client.answers import FINAL
from wingfit.client.client import Client
from wingfit.client.drive_answers import Simulation, Work
from wingfit.client.transport import WingfitError, is_passing
from wingfit.records import Series, SeriesDataset, load_dataset
from wingfit.rigs.dataset_model import model_of
from wingfit.rigs.declaration import RigDeclaration, declaration
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel
from wingfit.workers.share import child_environment, lower_priority

T = TypeVar("T")
OnWork = Callable[[Work], object]
BATCH_SECONDS = 0.5  # computing time of the simulations that are taken at once
MOST_AT_ONCE = 500
MOST_NUMBERS = 50_000  # in one message with several results
LONGEST_REASON = 2000  # characters
WAIT_SECONDS = 20.0  # that a request for simulations may take, where nothing is computed
ASK_SECONDS = 2.0  # after which the state of the job is asked for though nothing more can be taken
RETRY_SECONDS = 1.0  # after which a request is repeated that the server did not answer
HEARD_SECONDS = 20.0  # between signs of life
DISK_FULL = 507
LEAST_SECONDS = 1e-4  # of one simulation
BROKEN = 3  # times that a process ended with a simulation, after which this counts as failed


def drive(
    client: Client,
    job_id: str,
    rig: Rig,
    *,
    workers: int = 1,
    on_work: OnWork | None = None,
    patience_s: float = 600.0,
) -> Work:
    """Simulate ``rig`` for a run or diagnosis of a server until the job has ended; return its last state.

    Several processes, on any machines, may drive one job. If this one ends, the job waits for another.

    Args:
        client: of the server.
        job_id: id of a run or diagnosis that was submitted with the declaration of the rig.
        rig: the same rig. With more than one worker, its functions must be importable, or the rig loaded from a file.
        workers: number of processes that simulate.
        on_work: called with the state of the job after each answer of the server.
        patience_s: how long to go on without an answer of the server.

    Raises:
        WingfitError: the job has another rig, or the server refuses; ServerAwayError: it does not answer.
    """
    work = _first(client, job_id, rig)
    with tempfile.TemporaryDirectory(prefix="wingfit-") as folder:
        path = client.download(work["dataset_id"], Path(folder))
        dataset = load_dataset(path)
    if not isinstance(dataset, SeriesDataset):
        raise WingfitError("not a job of a rig", f"{job_id} is on a wing or a vehicle, which the server simulates")
    with _Computing(_Simulator(rig, dataset), workers) as computing:
        return _Driver(client, job_id, computing, on_work or (lambda _: None), patience_s).run()


def _first(client: Client, job_id: str, rig: Rig) -> Work:
    """Return the state of the job; WingfitError if its rig differs from ``rig``."""
    work = client.take_work(job_id, "look", limit=0, with_rig=True, leaving=True)
    mine, theirs = (RigDeclaration.model_validate(one).model_dump() for one in (declaration(rig), work["rig"]))
    different = [name for name in mine if name != "description" and mine[name] != theirs[name]]
    if different:
        raise WingfitError(
            "this is another rig",
            f"{different[0]} of rig {rig.name!r}: not those with which {job_id} was submitted; give the same rig, or "
            "submit the job again",
        )
    return work


class _Simulator:
    """Computes single simulations; sent to worker processes once."""

    def __init__(self, rig: Rig, dataset: SeriesDataset) -> None:
        self._dataset, self._model = dataset, model_of(rig, dataset)
        self._models: dict[tuple[str, ...], RigModel] = {}

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_models": {}}

    def compute(self, simulation: Simulation) -> dict[str, Any]:
        """Return the result of ``simulation`` as the server takes it.

        An error that is not the failure of an individual, such as a misspelt name, ends the job.
        """
        try:
            return self._computed(simulation)
        except Exception as error:
            return {"id": simulation["id"], "error": f"{type(error).__name__}: {error}"[:LONGEST_REASON]}

    def _computed(self, simulation: Simulation) -> dict[str, Any]:
        effects = tuple(simulation["effects"])
        if effects not in self._models:
            self._models[effects] = self._model.with_effects(*effects)
        recording = _changed(self._dataset.recording(simulation["recording"]), simulation)
        channels, reason = self._models[effects].simulated(simulation["genes"], recording)
        if reason is None and not np.isfinite(channels).all():
            reason = "a simulated channel is not finite"
        if reason is not None:
            return {"id": simulation["id"], "reason": reason[:LONGEST_REASON]}
        columns = zip(recording.channels, channels.T.tolist(), strict=True)
        return {"id": simulation["id"], "channels": dict(columns)}


def _changed(recording: Series, simulation: Simulation) -> Series:
    """Return ``recording`` with the settings and inputs of ``simulation``."""
    settings, factors = simulation["settings"], simulation["input_factors"]
    if not settings and not factors:
        return recording
    inputs = {name: factors.get(name, 1.0) * values for name, values in recording.inputs.items()}
    return replace(recording, settings={**recording.settings, **settings}, inputs=inputs)


_HERE: list[_Simulator] = []  # in a worker process


def _begin(simulator: _Simulator) -> None:
    lower_priority()
    _HERE[:] = [simulator]


def _begun() -> bool:
    return bool(_HERE)


def _compute(simulation: Simulation) -> dict[str, Any]:
    return _HERE[0].compute(simulation)


class _Computing:
    """Computes simulations, in this process or in ``workers`` others; a context manager, at whose end these close.

    A process that ends is replaced. What was under way is then computed again, one at a time, to find which simulation
    ends its process; one that does so BROKEN times has failed.
    """

    def __init__(self, simulator: _Simulator, workers: int) -> None:
        self._simulator, self._workers = simulator, workers
        self._queue: deque[Simulation] = deque()
        self._doubtful: deque[Simulation] = deque()  # one of them ended a process
        self._present: list[Simulation] = []  # in this process
        self._under_way: dict[Future[dict[str, Any]], Simulation] = {}
        self._broken: Counter[str] = Counter()
        self._pool = self._new_pool()
        self._check_pool()
        self._seconds = BATCH_SECONDS  # that one simulation takes

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool:
            self._pool.shutdown(wait=False, cancel_futures=True)

    def _check_pool(self) -> None:
        """WingfitError if processes cannot load the rig."""
        try:
            with child_environment():
                if self._pool:
                    self._pool.submit(_begun).result()
        except Exception as error:
            self.__exit__()
            cause = "" if isinstance(error, BrokenProcessPool) else f": {type(error).__name__}: {error}"
            raise WingfitError(
                "the rig cannot be loaded by other processes",
                f"its functions must be importable there{cause}; give workers=1, or load the rig from a file",
            ) from None

    @property
    def holding(self) -> list[str]:
        """Ids of the simulations that are not finished; may be called in another thread."""
        waiting = (*self._queue.copy(), *self._doubtful.copy(), *self._under_way.copy().values())
        return [one["id"] for one in (*self._present, *waiting)]

    @property
    def room(self) -> int:
        """Number of further simulations that will be computed within about BATCH_SECONDS."""
        most = int(BATCH_SECONDS * self._workers / self._seconds)
        return max(min(max(most, self._workers), MOST_AT_ONCE) - len(self.holding), 0)

    def add(self, simulations: Iterable[Simulation]) -> None:
        """Queue ``simulations``."""
        self._queue.extend(simulations)

    def finished(self) -> list[dict[str, Any]]:
        """Compute for about BATCH_SECONDS, less if nothing is queued any more, and return the results."""
        began, results = time.monotonic(), list[dict[str, Any]]()
        while self.holding and time.monotonic() - began < BATCH_SECONDS:
            results += self._some() if self._pool else [self._next()]
        if results:
            self._seconds = max((time.monotonic() - began) * self._workers / len(results), LEAST_SECONDS)
        return results

    def _next(self) -> dict[str, Any]:
        """Compute a simulation in this process."""
        self._present = [self._queue.popleft()]
        result = self._simulator.compute(self._present[0])
        self._present = []
        return result

    def _some(self) -> list[dict[str, Any]]:
        """Keep the processes busy, and return what they finish within BATCH_SECONDS."""
        source, most = (self._doubtful, 1) if self._doubtful else (self._queue, self._workers)
        with child_environment():
            while source and len(self._under_way) < most and self._pool:
                self._under_way[self._pool.submit(_compute, source[0])] = source[0]
                source.popleft()
        results, lost = list[dict[str, Any]](), list[Simulation]()
        for future in wait(self._under_way, BATCH_SECONDS, FIRST_COMPLETED).done:
            simulation = self._under_way.pop(future)
            try:
                results.append(future.result())
            except BrokenProcessPool:
                lost.append(simulation)
        return results + (self._replaced(lost) if lost else [])

    def _replaced(self, lost: list[Simulation]) -> list[dict[str, Any]]:
        """Start new processes, queue again what was ``lost`` with the old ones, and return what has failed for good."""
        lost += self._under_way.values()
        self._under_way.clear()
        if self._pool:
            self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = self._new_pool()
        if len(lost) == 1:  # no other simulation can have ended the process
            self._broken[lost[0]["id"]] += 1
        self._doubtful.extend(one for one in lost if self._broken[one["id"]] < BROKEN)
        reason = f"the simulation ended its process, {BROKEN} times"
        return [{"id": one["id"], "reason": reason} for one in lost if self._broken[one["id"]] >= BROKEN]

    def _new_pool(self) -> ProcessPoolExecutor | None:
        if self._workers == 1:
            return None
        return ProcessPoolExecutor(self._workers, get_context("spawn"), _begin, (self._simulator,))


class _Driver:
    """Takes simulations of a job, has them computed, and returns the results, until the job has ended."""

    def __init__(self, client: Client, job_id: str, computing: _Computing, on_work: OnWork, patience_s: float) -> None:
        self._client, self._job, self._computing = client, job_id, computing
        self._on_work, self._patience = on_work, patience_s
        self._name = f"driver-{uuid.uuid4().hex[:12]}"
        self._asked = 0.0

    def run(self) -> Work:
        over = threading.Event()
        heard = threading.Thread(target=self._stay_heard, args=(over,), name="wingfit-drive", daemon=True)
        heard.start()
        try:
            while True:
                if self._computing.room or time.monotonic() - self._asked > ASK_SECONDS:
                    work = self._patiently(self._take)
                    self._on_work(work)
                    if work["state"] in FINAL:
                        return work
                    self._computing.add(work["simulations"])
                for message in _messages(self._computing.finished()):
                    self._patiently(partial(self._client.return_results, self._job, self._name, message))
        finally:
            over.set()
            heard.join(HEARD_SECONDS)
            with suppress(WingfitError):
                self._client.take_work(self._job, self._name, limit=0, leaving=True)

    def _stay_heard(self, over: threading.Event) -> None:
        """Let the server know of this driver while a long simulation is computed."""
        while not over.wait(HEARD_SECONDS):
            with suppress(WingfitError):
                self._client.take_work(self._job, self._name, limit=0, holding=self._computing.holding)

    def _take(self) -> Work:
        self._asked, holding = time.monotonic(), self._computing.holding
        wait_s, room = 0.0 if holding else WAIT_SECONDS, self._computing.room
        return self._client.take_work(self._job, self._name, limit=room, wait_s=wait_s, holding=holding)

    def _patiently(self, send: Callable[[], T]) -> T:
        """Return what ``send`` returns; where the server does not answer, try again until the patience ends."""
        since = time.monotonic()
        while True:
            try:
                return send()
            except WingfitError as error:
                passing = is_passing(error) or error.status == DISK_FULL
                if not passing or time.monotonic() - since > self._patience:
                    raise
            time.sleep(RETRY_SECONDS)


def _messages(results: Sequence[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    """Yield ``results`` in groups of at most MOST_NUMBERS numbers and MOST_AT_ONCE results."""
    group, size = list[dict[str, Any]](), 0
    for result in results:
        numbers = sum(len(values) for values in result.get("channels", {}).values())
        if group and (size + numbers > MOST_NUMBERS or len(group) == MOST_AT_ONCE):
            yield group
            group, size = [], 0
        group, size = [*group, result], size + numbers
    if group:
        yield group
