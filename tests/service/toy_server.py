"""A server with the toy search: ``python -m tests.service.toy_server SECONDS``, settings from the environment.

A second number is the time in s after which a client that does not read is disconnected.
"""

from __future__ import annotations

import sys

from tests.service.toy import NoEvaluator, ToyEngine
from tests.service.toy_diagnosis import ToyDiagnoser
from wingfit.service.http import header_limits
from wingfit.service.server import ServeError, serve
from wingfit.service.settings import Settings, SettingsError

if __name__ == "__main__":
    try:
        seconds = float(sys.argv[1])
        if len(sys.argv) > 2:
            header_limits.SLOW_SECONDS = float(sys.argv[2])
        engine, diagnoser = ToyEngine(seconds), ToyDiagnoser(seconds)
        serve(Settings.from_env(), engine=engine, make_evaluator=NoEvaluator, diagnoser=diagnoser)
    except (ServeError, SettingsError) as error:
        sys.exit(f"wingfit: {error}")
