"""A server with the toy search: ``python -m tests.service.toy_server SECONDS``, settings from the environment."""

from __future__ import annotations

import sys

from service.server import ServeError, serve
from service.settings import Settings, SettingsError
from tests.service.toy import NoEvaluator, ToyEngine

if __name__ == "__main__":
    try:
        serve(Settings.from_env(), engine=ToyEngine(float(sys.argv[1])), make_evaluator=NoEvaluator)
    except (ServeError, SettingsError) as error:
        sys.exit(f"wingfit: {error}")
