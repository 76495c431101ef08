from __future__ import annotations

import subprocess
import sys

import pytest

from wingfit.workers.share import NICENESS

LOWERED = "import os, wingfit.workers.share as share; os.nice({0}); share.lower_priority(); print(os.nice(0))"


@pytest.mark.parametrize("niceness", [0, NICENESS + 5])
def test_the_priority_of_a_worker_is_lowered_and_never_raised(niceness: int) -> None:
    command = [sys.executable, "-c", LOWERED.format(niceness)]
    found = int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert found >= max(NICENESS, niceness)
