"""A door to any program: a request as JSON on its standard input, channels as JSON or CSV on its standard output.

A request is one line, a JSON object:

- ``format``: 1;
- ``id``: number of the request, which the answer of a persistent program repeats;
- ``recording``: name of the recording;
- ``genes``: value of each gene by name, suspects included (zero: off);
- ``settings``: value of each setting by name;
- ``times``: [T], s, at which channels are wanted, increasing;
- ``inputs``: samples [N] of each input by name, linear between ``input_times`` ([N], s) and constant beyond;
- ``channels``: names of the channels that are wanted.

The answer is ``{"channels": {"angle": [...], ...}}`` with T numbers each, or ``{"error": "why it is impossible"}``.
With ``answer="csv"`` it is a line with the names of columns, then a line for each time. Log messages go to standard
error.
"""

from __future__ import annotations

import csv
import io
import json
import os
import threading
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from wingfit.records.array_types import Array
from wingfit.rigs.doors.door import DoorError, checked, short
from wingfit.rigs.doors.program import Ended, Late, Program
from wingfit.rigs.run import Run, SimulationError

FORMAT = 1
TIMEOUT = 60.0  # s
REQUIRED = 'one line of JSON, such as {"channels": {"angle": [0.1, 0.2]}}'


def command(
    program: Sequence[str | os.PathLike[str]],
    channels: Sequence[str],
    *,
    answer: Literal["json", "csv"] = "json",
    persistent: bool = False,
    timeout: float = TIMEOUT,
    folder: str | os.PathLike[str] | None = None,
    environment: Mapping[str, str] | None = None,
) -> Command:
    """Return a ``simulate`` that runs ``program`` for each simulation; see the module for request and answer.

    Args:
        program: the program and its arguments, a word each; no shell reads them.
        channels: names of the channels that the program returns.
        answer: form of the answer.
        persistent: whether one program, started once in each process, answers all simulations: a line of JSON for each
            line that it reads, until its standard input ends. Spares the start of a program for each simulation.
        timeout: s; after it the program is killed, and the individual has failed.
        folder: in which the program runs; that of this process if not given.
        environment: variables that are set in addition to those of this process.
    """
    if isinstance(program, str | bytes) or not program:
        raise DoorError(
            f"program is {program!r}; give a list of the program and its arguments, ['./simulate', '--fast']"
        )
    if isinstance(channels, str) or not channels:
        raise DoorError(f"channels is {channels!r}; give a list of names, such as ['angle']")
    if not timeout > 0.0:
        raise DoorError(f"timeout is {timeout!r}; give a positive number of seconds")
    if persistent and answer == "csv":
        raise DoorError('a persistent program answers one line of JSON; use answer="json"')
    words = tuple(os.fspath(word) for word in program)
    place = None if folder is None else str(Path(folder).absolute())
    return Command(words, tuple(channels), answer, persistent, timeout, place, dict(environment or {}))


@dataclass(frozen=True, eq=False)
class Command:
    """Simulates with a program; see :func:`command`, which checks the arguments."""

    program: tuple[str, ...]
    channels: tuple[str, ...]
    answer: Literal["json", "csv"]
    persistent: bool
    timeout: float
    folder: str | None
    environment: dict[str, str]
    _own: _Running = field(init=False, default_factory=lambda: _Running())

    def __getstate__(self) -> dict[str, Any]:
        """Pickle everything but the running program: another process starts its own."""
        return {**self.__dict__, "_own": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _own=_Running())

    def __call__(self, genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        """Return the channels [T] of ``run`` for ``genes``, as the program computes them."""
        text = self._answered(genes, run)
        found = _from_csv(text) if self.answer == "csv" else self._from_json(text)
        return checked(found, self.channels, len(run.times), self._name)

    @property
    def _name(self) -> str:
        return Path(self.program[0]).name

    def _answered(self, genes: Mapping[str, float], run: Run) -> str:
        with self._own.lock:
            program = self._own.taken() or self._started()
            program.requests += 1
            request = _request(genes, run, self.channels, program.requests) + "\n"
            try:
                text = program.ask(request, self.timeout, self.persistent)
            except Late as late:
                raise SimulationError(f"{self._name} did not answer within {self.timeout:g} s{late}") from late
            except Ended as end:
                if end.code == 0:
                    raise DoorError(
                        f"{self._name} ended without an answer; answer every line that is read, until the standard "
                        f"input ends, or use persistent=False{end.said}"
                    ) from end
                raise SimulationError(f"{self._name} ended with {end}") from end
            finally:
                self._own.keep(program)
                if not (self.persistent and program.answered == program.requests):
                    self._own.end()
            if self.persistent and program.requests != (found := _identity(text)):
                self._own.end()
                raise DoorError(
                    f'{self._name} answered request {program.requests} with "id": {found}; write one line for each '
                    'line that is read, and repeat its "id"'
                )
            return text

    def _started(self) -> Program:
        try:
            return Program(self.program, self.folder, {**os.environ, **self.environment})
        except OSError as error:
            if self.folder and not Path(self.folder).is_dir():
                raise DoorError(f"there is no folder {self.folder}; give one in which {self._name} can run") from error
            raise DoorError(
                f"{self.program[0]!r} cannot be started: {error.strerror}; give the path of a program that may be "
                "executed, or an interpreter before it (['python3', 'simulate.py'])"
            ) from error

    def _from_json(self, text: str) -> Mapping[str, Any]:
        try:
            found = json.loads(text)
        except ValueError as error:
            raise DoorError(
                f"{self._name} must write {REQUIRED}, and log messages to standard error; it wrote: {short(text)!r}"
            ) from error
        if isinstance(found, dict) and isinstance(found.get("error"), str):
            raise SimulationError(short(found["error"]))
        if not (isinstance(found, dict) and isinstance(found.get("channels"), dict)):
            raise DoorError(f"{self._name} must write {REQUIRED}; it wrote: {short(text)!r}")
        channels: Mapping[str, Any] = found["channels"]
        return channels


class _Running:
    """The program of this process that is running, killed with the object that owns it."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self._held: list[Program] = []
        weakref.finalize(self, _kill_all, self._held)

    def taken(self) -> Program | None:
        """Return the program that waits for a request, if it belongs to this process and lives."""
        if self._held and self._held[0].waits:
            return self._held[0]
        self.end()
        return None

    def keep(self, program: Program) -> None:
        """Keep ``program`` for the next request."""
        self._held[:] = [program]

    def end(self) -> None:
        """Kill the program, if there is one."""
        _kill_all(self._held)


def _kill_all(programs: list[Program]) -> None:
    while programs:
        programs.pop().kill()


def _request(genes: Mapping[str, float], run: Run, channels: Sequence[str], number: int) -> str:
    return json.dumps(
        {
            "format": FORMAT,
            "id": number,
            "recording": run.recording,
            "genes": {name: float(value) for name, value in genes.items()},
            "settings": {name: float(value) for name, value in run.settings.items()},
            "times": run.times.tolist(),
            "inputs": {name: values.tolist() for name, values in run.inputs.items()},
            "input_times": run.input_times.tolist(),
            "channels": list(channels),
        }
    )


def _identity(text: str) -> int | None:
    """Return the "id" of an answer; None if there is none."""
    try:
        found = json.loads(text)
    except ValueError:
        return None
    identity = found.get("id") if isinstance(found, dict) else None
    return identity if isinstance(identity, int) else None


def _from_csv(text: str) -> dict[str, list[str]]:
    rows = [row for row in csv.reader(io.StringIO(text)) if row]
    if not rows:
        return {}
    names = [name.strip() for name in rows[0]]
    wrong = next((k for k, row in enumerate(rows) if len(row) != len(names)), None)
    if wrong is not None:
        raise DoorError(
            f"line {wrong + 1} of the CSV has {len(rows[wrong])} columns, its first line {len(names)} names; write one "
            "value for each name"
        )
    return {name: [row[k] for row in rows[1:]] for k, name in enumerate(names)}
