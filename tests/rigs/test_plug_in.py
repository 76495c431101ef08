"""A rig that is installed as a plug-in: found by name, and loaded by the processes that simulate it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

MODULE = """
import numpy as np
from wingfit import Gene, Rig

def simulate(genes, run):
    return {"charge": np.exp(-genes["rate"] * run.times)}

mine = Rig(name="decay", genes=[Gene("rate", "1/s", 1.0, 0.2, 5.0)], channels={"charge": "C"}, simulate=simulate)
"""
SCRIPT = """
import numpy as np
from wingfit.calibration.problem import Problem, base_genome
from wingfit.records import Channel, Series
from wingfit.rigs.load import load_rig, plug_ins
from wingfit.rigs.rig_model import RigModel
from wingfit.workers import make_evaluator

if __name__ == "__main__":
    assert plug_ins() == ("decay",), plug_ins()
    times = np.linspace(0.0, 1.0, 9)
    series = Series("one", times, (Channel("charge", "C"),), np.exp(-times)[:, None])
    model = RigModel(load_rig("decay"), (series,))
    problem = Problem(model, (series,), ("rate",), base_genome(model))
    values = np.linspace(0.5, 2.0, 20)[:, None]
    found = []
    for kind, workers in (("in_process", None), ("processes", 2)):
        evaluator = make_evaluator(kind, workers)
        found.append(evaluator.evaluate(problem, values).fitness)
        evaluator.close()
    np.testing.assert_array_equal(*found)
    print("the same", found[0][0])
"""


def test_processes_load_a_plug_in_by_its_name(tmp_path: Path) -> None:
    about = tmp_path / "decay_rig-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: decay-rig\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[wingfit.rigs]\ndecay = decay_plug_in:mine\n")
    (tmp_path / "decay_plug_in.py").write_text(MODULE)
    (tmp_path / "script.py").write_text(SCRIPT)
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("the same")
