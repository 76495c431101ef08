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
        seconds, *slow = map(float, sys.argv[1:])
        header_limits.SLOW_SECONDS = next(iter(slow), header_limits.SLOW_SECONDS)
        engine, diagnoser = ToyEngine(seconds), ToyDiagnoser(seconds)
        serve(Settings.from_env(), engine=engine, make_evaluator=NoEvaluator, diagnoser=diagnoser)
    except (ServeError, SettingsError) as error:
        sys.exit(f"wingfit: {error}")
