"""Sealed answers: one file each, with their hashes in a manifest that is closed before the first diagnosis.

Each file contains a random number too, so that an answer cannot be found by hashing guesses.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.concealed.answer import Answer

MANIFEST = "manifest.json"


class BrokenSealError(ValueError):
    """An answer differs from the one that was sealed."""


def seal(answer: Answer, folder: Path) -> str:
    """Write ``answer`` into ``folder`` and return its SHA-256."""
    salt = np.random.default_rng([answer.seed, 7]).bytes(16).hex()
    text = json.dumps({"salt": salt, "answer": answer.as_json()}, sort_keys=True, indent=1)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{answer.trial}.json").write_text(text, encoding="utf-8")
    return digest(text)


def digest(text: str) -> str:
    """SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def close(hashes: Mapping[str, str], folder: Path) -> str:
    """Write the manifest of all hashes and return its own hash, which is printed before the diagnosis.

    BrokenSealError if the folder was closed before and an answer has changed since.
    """
    path = folder / MANIFEST
    before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if changed := [name for name, known in before.items() if hashes.get(name, known) != known]:
        raise BrokenSealError(f"answers have changed since they were sealed: {', '.join(changed)}; run them again")
    text = json.dumps(dict(sorted(hashes.items())), indent=1)
    path.write_text(text, encoding="utf-8")
    return digest(text)


def open_seal(trial: str, folder: Path, manifest: str) -> Answer:
    """The answer of ``trial``.

    BrokenSealError if the answer does not match the manifest in ``folder``, or that does not match the hash
    ``manifest``.
    """
    listed = (folder / MANIFEST).read_text(encoding="utf-8")
    if digest(listed) != manifest:
        raise BrokenSealError(
            f"the manifest has sha256 {digest(listed)}, but {manifest} was closed; run the trials again"
        )
    expected = json.loads(listed).get(trial)
    text = (folder / f"{trial}.json").read_text(encoding="utf-8")
    if digest(text) != expected:
        raise BrokenSealError(
            f"the answer of {trial} has sha256 {digest(text)}, but {expected} was sealed; run it again"
        )
    return Answer.from_json(json.loads(text)["answer"])


def read(path: Path) -> Answer:
    """An answer for the plant's own use, to record its rig again."""
    return Answer.from_json(json.loads(path.read_text(encoding="utf-8"))["answer"])
