"""Sealed answers of the blind trials: proof that the answers did not change after the first diagnosis.

Each answer is a JSON file; a manifest holds the SHA-256 of all files, and its own hash is printed before the first
diagnosis. Each file contains a random number too, so that an answer cannot be found by hashing guesses.
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
    """Write the manifest of ``hashes`` (by trial) into ``folder``, and return its own SHA-256.

    BrokenSealError if the folder already has a manifest with another hash for one of these trials.
    """
    path = folder / MANIFEST
    before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if changed := [name for name, known in before.items() if hashes.get(name, known) != known]:
        raise BrokenSealError(f"answers have changed since they were sealed: {', '.join(changed)}; run them again")
    text = json.dumps(dict(sorted(hashes.items())), indent=1)
    path.write_text(text, encoding="utf-8")
    return digest(text)


def open_seal(trial: str, folder: Path, manifest: str) -> Answer:
    """The answer of ``trial``, read from ``folder``.

    BrokenSealError if the answer's hash differs from that in the folder's manifest, or the manifest's own hash from
    ``manifest``, which :func:`close` returned.
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
    """The answer in the file ``path``, without a check; for simulating further recordings of the same rig."""
    return Answer.from_json(json.loads(path.read_text(encoding="utf-8"))["answer"])
