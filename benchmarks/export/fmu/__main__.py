"""``python -m benchmarks.export.fmu --json``: the part of ``benchmarks.export`` on FMUs, by itself."""

from __future__ import annotations

import argparse
import json

from benchmarks.common.machine import commit, cpu
from benchmarks.export.fmu import measured

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.parse_args()
    print(json.dumps({**measured(), "commit": commit(), "processor": cpu()}))
