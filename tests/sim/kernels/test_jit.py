"""The cache of compiled kernels: it may not outlive the code it was compiled from."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numba
import pytest

from wingfit.sim.kernels import jit

HELPER = "from tiny.jit import {how}\n\n@{how}\ndef factor(x):\n    return {factor} * x\n"
KERNEL = "from tiny.helper import factor\nfrom tiny.jit import kernel\n\n@kernel\ndef f(x):\n    return factor(x)\n"
RUN = "from tiny.kernel import f; print(f(3.0), sum(f.stats.cache_hits.values()))"


def run(place: Path, **more: str) -> list[str]:
    """What the kernel of the package in ``place`` gives in a process of its own, and how often it was in the cache."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA")} | more
    found = subprocess.run(
        [sys.executable, "-c", RUN], cwd=place, capture_output=True, text=True, check=True,
        env={**environment, "PYTHONPATH": str(place), "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    return found.stdout.split()


@pytest.mark.parametrize("how", ["kernel", "inlined"])
def test_a_changed_helper_is_compiled_into_its_callers(tmp_path: Path, how: str) -> None:
    """The helper is in another file than the cached kernel, which numba by itself would go on using."""
    package = tmp_path / "tiny"
    package.mkdir()
    shutil.copy(jit.__file__, package / "jit.py")
    (package / "__init__.py").touch()
    (package / "kernel.py").write_text(KERNEL)
    (package / "helper.py").write_text(HELPER.format(how=how, factor=2))
    assert run(tmp_path) == ["6.0", "0"]
    assert run(tmp_path) == ["6.0", "1"], "unchanged code comes from the cache"
    (package / "helper.py").write_text(HELPER.format(how=how, factor=3))
    assert run(tmp_path) == ["9.0", "0"]
    (package / "helper.py").write_text(HELPER.format(how=how, factor=2))
    assert run(tmp_path) == ["6.0", "1"], "a way back is in the cache too"


def test_a_read_only_installation_brings_its_kernels_along(tmp_path: Path) -> None:
    """Where nothing can be written beside the source, the cache elsewhere starts with what is there."""
    package, cache = tmp_path / "tiny", tmp_path / "cache"
    package.mkdir()
    shutil.copy(jit.__file__, package / "jit.py")
    (package / "__init__.py").touch()
    (package / "kernel.py").write_text(KERNEL)
    (package / "helper.py").write_text(HELPER.format(how="inlined", factor=2))
    assert run(tmp_path) == ["6.0", "0"]
    assert run(tmp_path, NUMBA_CACHE_DIR=str(cache)) == ["6.0", "1"]
    (folder,) = (cache / package.name).iterdir()
    (package / "helper.py").write_text(HELPER.format(how="inlined", factor=3))
    assert run(tmp_path, NUMBA_CACHE_DIR=str(cache)) == ["9.0", "0"], "what was compiled from other code is left behind"
    assert len(list((cache / package.name).iterdir())) == 2
    assert folder.is_dir()


def test_of_two_processes_that_start_a_cache_one_is_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped, folder = tmp_path / "shipped", tmp_path / "cache" / "kernels-1"
    shipped.mkdir()
    (shipped / "code").write_text("ours")
    copy_tree = shutil.copytree

    def slow(source: Path, target: Path, *, dirs_exist_ok: bool) -> Path:
        folder.mkdir()
        (folder / "code").write_text("theirs")
        return copy_tree(source, target, dirs_exist_ok=dirs_exist_ok)

    monkeypatch.setattr(shutil, "copytree", slow)
    jit._start_with(shipped, folder)
    assert (folder / "code").read_text() == "theirs"
    assert list(folder.parent.iterdir()) == [folder]


def test_a_numba_that_caches_elsewhere_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(jit, "_cached_in", lambda folder: nullcontext(folder))
    with pytest.raises(RuntimeError, match=r"CACHE_DIR"):
        jit.kernel(lambda x: x)


def test_where_no_cache_can_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside the source, else in the user's cache, else an error that says what to set."""
    (tmp_path / "file").touch()
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert jit.cache_folder.__wrapped__(tmp_path).parent == tmp_path / "wingfit" / tmp_path.stem
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(OSError, match="NUMBA_CACHE_DIR"):
        jit.cache_folder.__wrapped__(tmp_path)


def test_old_caches_are_forgotten(tmp_path: Path) -> None:
    for age in range(12):
        folder = tmp_path / f"kernels-{age}"
        folder.mkdir()
        os.utime(folder, (1e9 - age, 1e9 - age))
    jit._forget_old(tmp_path)
    assert sorted(int(p.name.split("-")[1]) for p in tmp_path.iterdir()) == list(range(8))


def test_a_cache_that_another_process_removes_meanwhile_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the place would count as one that cannot be written, and all kernels would be compiled elsewhere."""
    (tmp_path / "kernels-here").mkdir()
    monkeypatch.setattr(Path, "glob", lambda self, _: iter([self / "kernels-here", self / "kernels-gone"]))
    jit._forget_old(tmp_path)
    assert (tmp_path / "kernels-here").is_dir()
