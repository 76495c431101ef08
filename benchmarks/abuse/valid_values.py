"""Valid values for the requests that a fuzzer generates.

A generated id refers to no object and a generated archive cannot be read, so that nearly every request would be refused
early. The values depend only on the request and the seed. This module imports only the standard library, because the
fuzzer may run in another Python environment.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

Json = dict[str, Any]
Fillers = Mapping[str, Callable[[], Any]]
KINDS = ("tracks", "forces")
ID = re.compile(r"(?:ds|run|dx|key)_[0-9a-f]{16}")
ABSENT = "0" * 16
OFTEN, SELDOM = 0.8, 0.3
REPEAT_KEY = "Idempotency-Key"
# Fields with which a request would be refused: by kind of dataset, those of the other kind; IDLE: by method, those
# that mean nothing for it.
FOREIGN: Mapping[str, tuple[str, ...]] = {
    "tracks": ("preset", "without", "axes", "low_pass_hz", "peel_width_beats"),
    "forces": ("division", "bounds_factor", "accuracy_mm", "outputs"),
}
IDLE: Mapping[str, tuple[str, ...]] = {
    "gauss_newton": ("population", "stall", "tolerance", "finish"),
    "auto": ("finish",),
}
OF_KIND = {"/comparison": "tracks", "/loads": "tracks", "/forces": "forces", "/predictions": "forces"}
SMALL_DIVISIONS = ("4", "2,2", "3x1", "11")
LARGEST: Mapping[str, int] = {"population": 8, "max_generations": 2, "stall": 2, "refits": 1}


class ValidValues:
    """Puts valid values into a request.

    ``good``: valid values, of :func:`benchmarks.abuse.valid_inputs.values`; ``archives``: datasets to upload. In the
    methods, ``dice`` is the random number generator for the request.
    """

    def __init__(self, good: Json, archives: Sequence[bytes], seed: int) -> None:
        self._good, self._archives, self._seed = good, archives, seed
        kept = [good["diagnosis_id"], good["key_id"]]
        self._kept = frozenset(kept + [good[kind][name] for kind in KINDS for name in ("dataset_id", "run_id")])

    def dice(self, *request: object) -> random.Random:
        """Return a random number generator that depends only on the seed and the parts of the ``request``."""
        return random.Random(f"{self._seed} {request!r}")  # noqa: S311  no secret

    def kind(self, path: str, dice: random.Random) -> str:
        """Return the kind, "tracks" or "forces", of the objects to refer to: mostly the one that ``path`` accepts."""
        only = next((kind for end, kind in OF_KIND.items() if path.endswith(end)), None)
        return only if only and dice.random() < OFTEN else dice.choice(KINDS)

    def spared(self, given: Mapping[str, Any]) -> Json:
        """Return the path parameters ``given`` of a deletion, with ids of needed objects replaced by invalid ones.

        Other requests need these objects.
        """
        return {name: _absent(value) if value in self._kept else value for name, value in given.items()}

    def parameters(self, given: Mapping[str, Any], kind: str, dice: random.Random) -> Json:
        """Return the ``given`` parameters of a path or a query with most values replaced by valid ones."""
        fillers = _fillers(self._good, kind, dice)
        fillers = {**fillers, "name": lambda: dice.choice(self._good["effects"])}
        return {name: self._filled(name, value, fillers, dice) for name, value in given.items()}

    def headers(self, given: Mapping[str, Any], dice: random.Random) -> Json:
        """Return the ``given`` headers, mostly with a new idempotency key, because a used key would be refused."""
        fresh = REPEAT_KEY in given and dice.random() < OFTEN
        return {**given, **({REPEAT_KEY: f"{dice.getrandbits(64):x}"} if fresh else {})}

    def upload(self, given: Mapping[str, Any], dice: random.Random) -> Json:
        """Return arguments of the HTTP client that send a valid file with the fields ``given``; sometimes none."""
        if dice.random() > OFTEN:
            return {}
        fields = {name: value for name, value in given.items() if name != "file"}
        return {"files": {"file": ("good.zip", dice.choice(self._archives))}, "data": fields}

    def body(self, given: Any, kind: str, dice: random.Random) -> Any:
        """Return the JSON body ``given``, mostly with valid values for ``kind``, and always with small computations."""
        if not isinstance(given, dict):
            return given
        small = given | {name: min(given[name], most) for name, most in LARGEST.items() if name in given}
        if "division" in given:
            small["division"] = dice.choice(SMALL_DIVISIONS)
        return self._of_one_kind(small, kind, dice) if dice.random() < OFTEN else small

    def _filled(self, name: str, value: Any, fillers: Fillers, dice: random.Random) -> Any:
        """Return a random valid value for the field ``name``, or the given ``value``.

        An id that the fuzzer took from an answer of the server is mostly left unchanged.
        """
        served = isinstance(value, str) and ID.fullmatch(value) and value not in self._good["examples"]
        return fillers[name]() if name in fillers and dice.random() < (SELDOM if served else OFTEN) else value

    def _of_one_kind(self, given: Json, kind: str, dice: random.Random) -> Json:
        """Return the body ``given`` with valid values, without fields that do not belong to ``kind``."""
        fillers = _fillers(self._good, kind, dice)
        filled = {name: fillers[name]() if name in fillers else value for name, value in given.items()}
        excluded = FOREIGN[kind] + IDLE.get(str(filled.get("method")), ())
        return {name: value for name, value in filled.items() if name not in excluded}


def _fillers(good: Json, kind: str, dice: random.Random) -> Fillers:
    """Return functions that make a random valid value for a ``kind`` of dataset, by name of the parameter or field."""
    known, genes, names = good[kind], good[kind]["genes"], list(good[kind]["genes"])
    return {
        "dataset_id": lambda: known["dataset_id"],
        "run_id": lambda: known["run_id"],
        "diagnosis_id": lambda: good["diagnosis_id"],
        "key_id": lambda: good["key_id"],
        "key": lambda: good["key"],
        "mode": lambda: "joint",
        "recording": lambda: dice.choice(known["recordings"]),
        "recordings": lambda: _some(known["recordings"], dice),
        "genes": lambda: _some(names, dice),
        "genome": lambda: {name: genes[name] * dice.uniform(0.8, 1.25) for name in _some(names, dice)},
        "fixed": lambda: {name: genes[name] for name in _some(names, dice)},
        "effects": lambda: _some(known["effects"], dice),
        "suspects": lambda: dice.sample(known["effects"], 1),
        "without": lambda: _some(known["terms"], dice),
    }


def _some(names: list[str], dice: random.Random) -> list[str]:
    return dice.sample(names, min(len(names), dice.choice((0, 0, 1, 2))))


def _absent(served: str) -> str:
    return served[: -len(ABSENT)] + ABSENT
