"""Sealed answers of the blind trials: proof that the answers did not change after the first diagnosis.

Each answer is a JSON file; a manifest holds the SHA-256 of all files, and its own hash is printed before the first
diagnosis. Each file also contains a random number drawn from the trial's seed, so that an answer cannot be found by
hashing guesses without that seed.
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
    """A sealed answer, or the manifest of all hashes, was changed after it was written."""


def seal(answer: Answer, folder: Path) -> str:
    """Write ``answer`` into ``folder`` as a JSON file named after its trial; return the SHA-256 of the file."""
    salt = np.random.default_rng([answer.seed, 7]).bytes(16).hex()
    text = json.dumps({"salt": salt, "answer": answer.as_json()}, sort_keys=True, indent=1)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{answer.trial}.json").write_text(text, encoding="utf-8")
    return digest(text)


def digest(text: str) -> str:
    """SHA-256 of ``text`` in UTF-8, as hexadecimal digits."""
    return hashlib.sha256(text.encode()).hexdigest()


def close(hashes: Mapping[str, str], folder: Path) -> str:
    """Write the manifest, ``hashes`` (SHA-256 of each answer by trial), into ``folder``; return the manifest's SHA-256.

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
    """The answer in the file ``path``, without a check of its hash; to simulate further recordings of the same rig."""
    return Answer.from_json(json.loads(path.read_text(encoding="utf-8"))["answer"])
