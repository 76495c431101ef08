"""Names of markers: those that were not identified, prefixes, and characters that a dataset does not allow."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np

from wingfit.importers.options import ask
from wingfit.records.array_types import Mask
from wingfit.records.errors import Faults, check_most, counted, fail, nearest, shown
from wingfit.records.limits import MAX_MARKERS

_UNLABELLED = re.compile(
    r"|\*\d*|(?:unlabell?ed|unidentified|uname)[\s_*\-]*\d*|new[\s_]\d{3,}|(?:.*:)?\*\d+", re.IGNORECASE
)
_NOT_ALLOWED = re.compile(r"[^A-Za-z0-9._-]+")
_LONGEST = 64
_LISTED = 6


@dataclass(frozen=True)
class Names:
    """Markers that are imported: indices ``keep`` [M] in the file, ``labels`` [M] there, names ``markers`` [M]."""

    keep: list[int]
    labels: tuple[str, ...]
    markers: tuple[str, ...]
    remarks: tuple[str, ...]

    def only(self, seen: Mask) -> Names:
        """Return the names without the markers that are not ``seen`` [M], and with a remark about these."""
        return self._only(seen, "that are never seen")

    def chosen(self, text: str) -> Names:
        """Return the markers that ``text``, the option ``markers``, names: "tip,root", or "right_*".

        DatasetError lists the parts of ``text`` that name none.
        """
        faults, used = Faults(), np.zeros(len(self.markers), dtype=np.bool_)
        pairs = [*zip(self.markers, self.labels, strict=True)]
        parts = [*dict.fromkeys(filter(None, (piece.strip() for piece in text.split(","))))]
        if not parts:
            message = f"is {shown(text)!r}, which names no marker; write it like 'tip,root', or leave it out for all"
            raise fail("--markers", text, message)
        check_most("--markers", "has", len(parts), MAX_MARKERS, "names", "write several as one with *: 'right_*'")
        for part in parts:
            found = [fnmatchcase(name, part) or fnmatchcase(label, part) for name, label in pairs]
            if not any(found):
                message = f"no marker is called {shown(part)!r} ({nearest(part, self.markers)})"
                faults.add("--markers", part, f"{message}; * stands for any letters: 'right_*'")
            used |= found
            if faults.full:
                break
        faults.raise_any()
        return self._only(used, "that --markers does not name")

    def _only(self, used: Mask, why: str) -> Names:
        left = [name for name, there in zip(self.markers, used, strict=True) if not there]
        if not left:
            return self
        chosen = [k for k in range(len(self.markers)) if used[k]]
        return replace(
            self,
            keep=[self.keep[k] for k in chosen],
            labels=tuple(self.labels[k] for k in chosen),
            markers=tuple(self.markers[k] for k in chosen),
            remarks=(*self.remarks, f"not imported: {counted(len(left), 'marker')} {why} ({listed(left)})"),
        )


def listed(names: Sequence[str]) -> str:
    """Return the first six ``names``, and how many more there are."""
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more


def names_of(labels: Sequence[str], file: str, *, keep_unlabelled: bool) -> Names:
    """Return names for datasets from the ``labels`` of a file; DatasetError for labels that are used twice."""
    remarks, keep = [], [*range(len(labels))]
    if not keep_unlabelled:
        keep = [m for m in keep if not _UNLABELLED.fullmatch(labels[m].strip())]
        if len(keep) < len(labels):
            left = len(labels) - len(keep)
            remarks.append(f"not imported: {counted(left, 'unlabelled marker')}; to import all: --keep-unlabelled")
    if not keep:
        message = f"no marker of {len(labels)} has a label; label those of the wing, or give --keep-unlabelled"
        raise ask("keep_unlabelled", file, len(labels), message)
    chosen = [labels[m].strip() for m in keep]
    _check_repeated([label for label in chosen if not _UNLABELLED.fullmatch(label)], file)
    short, prefix = _without_prefix(chosen)
    if prefix:
        remarks.append(f"names are without the prefix {prefix!r} that all of them have")
    markers = _unique([allowed(label) or f"marker{m + 1}" for m, label in zip(keep, short, strict=True)])
    changed = [f"{old!r} is now {new}" for old, new in zip(short, markers, strict=True) if old != new]
    if changed:
        remarks.append(f"renamed, as a dataset allows letters, digits, '.', '_' and '-': {listed(changed)}")
    return Names(keep, tuple(chosen), tuple(markers), tuple(remarks))


def _check_repeated(labels: Sequence[str], file: str) -> None:
    faults = Faults()
    for label, count in Counter(labels).items():
        if count > 1:
            faults.add(
                file, label, f"{count} markers are called {shown(label)!r}; give each its own name and export again"
            )
    faults.raise_any()


def _without_prefix(labels: list[str]) -> tuple[list[str], str]:
    """Return the labels without the subject ("subject:marker") that all share, and the prefix; "" if there is none."""
    prefixes = {label.partition(":")[0] if ":" in label else "" for label in labels}
    if len(prefixes) != 1 or prefixes == {""}:
        return labels, ""
    prefix = f"{prefixes.pop()}:"
    short = [label.removeprefix(prefix).strip() for label in labels]
    return (short, prefix) if all(short) and len(set(short)) == len(short) else (labels, "")


def allowed(label: str) -> str:
    """Return ``label`` with other characters than a dataset allows replaced, accents first."""
    plain = unicodedata.normalize("NFKD", label.replace("ß", "ss")).encode("ascii", "ignore").decode()
    return _NOT_ALLOWED.sub("_", plain)[:_LONGEST].strip("._-")


def _unique(names: list[str]) -> list[str]:
    """Return ``names``, of which those that became equal have numbers."""
    used, unique = set[str](), list[str]()
    for name in names:
        new, number = name, 2
        while new in used:
            new, number = f"{name}-{number}", number + 1
        used.add(new)
        unique.append(new)
    return unique
