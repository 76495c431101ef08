"""Changes files at random, as transfers, editors, spreadsheets and malice do."""

from __future__ import annotations

import random
from collections.abc import Callable

TOKENS = (
    "NaN", "nan(ind)", "-1.#IND", "1.#QNAN0", "null", "N/A", "-", "inf", "-Infinity", "1e999", "1e-999", "1,5",
    "1.234,5", "1'234.5", "1 234.5", "0x10", "1_000", "٣", "½", "", " ", '"', '""', "'", "\ufeff", "\0", "x" * 70_000,
    "-0", "1e308", "9" * 500, "=A1", "12:30:01", "2024-05-02", "TRUE", "#REF!", "1;2", "\t", "é", "X", "Frame", "mm",
    "px", "-9999", "65536", "2147483648", "1e18",
)  # fmt: skip


def mutated(raw: bytes, others: list[bytes], dice: random.Random) -> bytes:
    """Return ``raw`` after one to three random changes; ``others``: files of other formats to mix in."""
    changes: list[Callable[[bytes, random.Random], bytes]] = [
        _cut, _cut_start, _remove, _repeat, _overwrite, _flip_header, _flip, _flip, _insert, _token, _token, _token,
        _swap_lines, _repeat_line, _separator, _encode,
    ]  # fmt: skip
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        raw = _mix(raw, dice.choice(others), dice) if dice.random() < 0.03 else dice.choice(changes)(raw, dice)
    return raw


def _place(raw: bytes, dice: random.Random) -> int:
    # Headers are short and matter most.
    end = min(len(raw), 1500) if dice.random() < 0.6 else len(raw)
    return dice.randrange(end + 1)


def _cut(raw: bytes, dice: random.Random) -> bytes:
    return raw[: _place(raw, dice)]


def _cut_start(raw: bytes, dice: random.Random) -> bytes:
    return raw[min(_place(raw, dice), 200) :]


def _remove(raw: bytes, dice: random.Random) -> bytes:
    at = _place(raw, dice)
    return raw[:at] + raw[at + dice.randint(1, 40) :]


def _repeat(raw: bytes, dice: random.Random) -> bytes:
    at = _place(raw, dice)
    return raw[: at + dice.randint(1, 400)] + raw[at:]


def _overwrite(raw: bytes, dice: random.Random) -> bytes:
    at, size = _place(raw, dice), dice.randint(1, 16)
    return raw[:at] + dice.randbytes(size) + raw[at + size :]


def _flip_header(raw: bytes, dice: random.Random) -> bytes:
    changed = bytearray(raw)
    for _ in range(min(len(raw), dice.randint(1, 4))):
        changed[dice.randrange(min(len(raw), 1100))] = dice.choice((0, 1, 127, 128, 255, dice.randrange(256)))
    return bytes(changed)


def _flip(raw: bytes, dice: random.Random) -> bytes:
    if not raw:
        return raw
    changed = bytearray(raw)
    changed[min(_place(raw, dice), len(raw) - 1)] ^= 1 << dice.randrange(8)
    return bytes(changed)


def _insert(raw: bytes, dice: random.Random) -> bytes:
    at = _place(raw, dice)
    return raw[:at] + dice.choice((b"\0", b"\n", b"\r", b"\n\n", b",", b"\t", b'"', b"\xff\xfe", b"\x1a")) + raw[at:]


def _token(raw: bytes, dice: random.Random) -> bytes:
    """Replace one cell of a text."""
    separators = [i for i, byte in enumerate(raw[:200_000]) if byte in b",\t;\n\r"]
    if len(separators) < 2:
        return raw + dice.choice(TOKENS).encode()
    early = dice.random() < 0.5
    k = dice.randrange(min(60, len(separators) - 1) if early else len(separators) - 1)
    return raw[: separators[k] + 1] + dice.choice(TOKENS).encode() + raw[separators[k + 1] :]


def _lines(raw: bytes) -> list[bytes]:
    return raw.splitlines(keepends=True)


def _swap_lines(raw: bytes, dice: random.Random) -> bytes:
    lines = _lines(raw)
    if len(lines) > 1:
        i, j = dice.randrange(min(len(lines), 12)), dice.randrange(len(lines))
        lines[i], lines[j] = lines[j], lines[i]
    return b"".join(lines)


def _repeat_line(raw: bytes, dice: random.Random) -> bytes:
    lines = _lines(raw)
    if lines:
        i = dice.randrange(len(lines))
        lines[i:i] = [lines[i]] * dice.randint(1, 3)
    return b"".join(lines)


def _separator(raw: bytes, dice: random.Random) -> bytes:
    return raw.replace(dice.choice((b",", b"\t", b".", b"\n")), dice.choice((b";", b",", b"\t", b" ", b"\r\n", b"|")))


def _encode(raw: bytes, dice: random.Random) -> bytes:
    return raw.decode("utf-8", errors="replace").encode(dice.choice(("utf-16", "utf-16-be", "utf-8-sig", "utf-32")))


def _mix(raw: bytes, other: bytes, dice: random.Random) -> bytes:
    at = _place(raw, dice)
    return raw[:at] + other + (raw[at:] if dice.random() < 0.5 else b"")
