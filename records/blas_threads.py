"""Runs linear algebra on one thread, so that results do not depend on the number of threads of the machine.

BLAS splits a matrix product among its threads, and the rounding depends on the split. A difference in the last bit can
change the outcome of a search or of a significance test. All code that computes numbers of a result therefore runs with
one BLAS thread (docs/decisions/0012-threads.md), whatever number the environment sets; the former number is
restored afterwards.
"""

from __future__ import annotations

import ctypes
import inspect
import itertools
import os
import sys
import threading
from collections.abc import Callable, Generator
from functools import wraps
from typing import Any, NamedTuple, TypeVar, cast

from threadpoolctl import LibController, ThreadpoolController

F = TypeVar("F", bound=Callable[..., Any])

# Prefixes and suffixes that builds of OpenBLAS add to the names of its functions.
_PREFIXES, _SUFFIXES = ("scipy_", ""), ("64_", "_64", "")


class _Library(NamedTuple):
    """The functions of one loaded BLAS library that return (``get``) and change (``set``) its number of threads."""

    get: Callable[[], int]
    set: Callable[[int], object]


def _library(found: LibController) -> _Library:
    """Return the functions that read and set the number of threads of the library ``found``.

    OpenBLAS's own functions are called, since those of threadpoolctl 3.8 work only in the first thread of a process.
    """
    if found.internal_api == "openblas" and found.threading_layer != "openmp":
        handle = ctypes.CDLL(found.filepath)
        for prefix, suffix in itertools.product(_PREFIXES, _SUFFIXES):
            name = f"{prefix}openblas_{{}}_num_threads{suffix}".format
            if hasattr(handle, name("set")):
                return _Library(getattr(handle, name("get")), getattr(handle, name("set")))
    return _Library(found.get_num_threads, found.set_num_threads)


class OneBlasThread:
    """Context manager and decorator that limits every loaded BLAS library to one thread.

    The limit belongs to the process. It holds while any thread is inside such a block; the last thread to leave
    restores the numbers of threads from before the first one entered. Entering takes a few microseconds, and blocks may
    be nested. A decorated generator is inside only while it computes its next item, not between items.
    """

    def __init__(self) -> None:
        # Re-entrant: while this thread enters, garbage collection may close a generator and so leave another block.
        self._lock = threading.RLock()
        self._inside = 0
        self._modules = 0
        self._libraries: dict[str, _Library] = {}
        self._former: dict[str, int] = {}
        # A forked process has only the thread that forked; a lock held by another thread would never be released in it.
        os.register_at_fork(
            before=self._lock.acquire, after_in_parent=self._lock.release, after_in_child=self._lock.release
        )

    def __enter__(self) -> None:
        with self._lock:
            if len(sys.modules) != self._modules:  # an import may have loaded another library
                self._scan()
            self._inside += 1
            for path, library in self._libraries.items():
                if path not in self._former:
                    self._former[path] = library.get()
                # Every time: other code may have raised it, and MKL has a separate setting for each thread.
                library.set(1)

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                former, self._former = self._former, {}
                for path, threads in former.items():
                    self._libraries[path].set(threads)

    def __call__(self, function: F) -> F:
        """Wrap ``function`` so that it runs with one BLAS thread; if it is a generator, each of its steps does."""

        @wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            with self:
                return function(*args, **kwargs)

        @wraps(function)
        def steps(*args: Any, **kwargs: Any) -> Generator[Any, None, Any]:
            return self._step_by_step(function(*args, **kwargs))

        guarded: Any = steps if inspect.isgeneratorfunction(function) else call
        guarded.one_blas_thread = True  # so that a test can see it
        return cast(F, guarded)

    def _step_by_step(self, generator: Generator[Any, None, Any]) -> Generator[Any, None, Any]:
        try:
            while True:
                try:
                    with self:
                        item = next(generator)
                except StopIteration as end:
                    return end.value
                yield item
        finally:
            generator.close()

    def _scan(self) -> None:
        """Add the BLAS libraries that are loaded to ``_libraries``, by file; takes about a millisecond."""
        self._modules = len(sys.modules)
        found = ThreadpoolController().select(user_api="blas").lib_controllers
        self._libraries |= {one.filepath: _library(one) for one in found if one.filepath not in self._libraries}


one_blas_thread = OneBlasThread()
