"""A UM-Bridge server (protocol 1.0) on loopback: the oscillator. For some values of the stiffness it misbehaves."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np

from tests.rigs.doors.oscillator import oscillate
from wingfit.rigs.run import Run

MODEL = "oscillator"


class RefusedError(Exception):
    """An error of the protocol, with its status."""

    def __init__(self, status: int, kind: str, message: str) -> None:
        super().__init__(message)
        self.status, self.kind = status, kind


class Server(ThreadingHTTPServer):
    """The server, and what it was asked."""

    daemon_threads = True

    def __init__(self, port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.asked: list[str] = []
        self.drop = 0  # requests whose connection is closed without an answer
        self.away = 0  # requests that are answered as by a proxy whose server is away
        self.version = 1.0
        self.evaluates = True
        self.layout = "separate"

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}"

    def answered(self, path: str, body: dict[str, Any]) -> Any:
        """The answer of the protocol to a request."""
        if path == "/Info":
            return {"protocolVersion": self.version, "models": [MODEL, "other"]}
        if body["name"] != MODEL:
            raise RefusedError(400, "ModelNotFound", f"Model {body['name']} not supported!")
        if path == "/ModelInfo":
            return {"support": {"Evaluate": self.evaluates, "Gradient": False}}
        config = body["config"]
        count = len(config["times"])
        if path == "/InputSizes":
            return {"inputSizes": [2, 2]}
        sizes = [2 * count] if self.layout == "joined" else [count, count, 1]
        if path == "/OutputSizes":
            return {"outputSizes": sizes}
        assert path == "/Evaluate", path
        return {"output": self._evaluated(body["input"], config)}

    def _evaluated(self, vectors: list[list[float]], config: dict[str, Any]) -> list[list[float]]:
        (stiffness, damping), (mass, start) = vectors
        assert mass == config["settings"]["mass"]
        if 50.0 < stiffness < 51.0:
            raise ArithmeticError("the spring breaks")
        if 51.0 < stiffness < 52.0:
            raise RefusedError(500, "InvalidOutput", "Model output is not a list of lists!")
        if 52.0 < stiffness < 53.0:
            time.sleep(2.0)
        times, inputs = (np.array(config[name]) for name in ("times", "input_times"))
        run = Run(config["recording"], times, config["settings"],
                  {name: np.array(one) for name, one in config["inputs"].items()}, inputs)  # fmt: skip
        found = oscillate({"stiffness": stiffness, "damping": damping, "start": start}, run)
        position, speed = found["position"].tolist(), found["speed"].tolist()
        if 53.0 < stiffness < 54.0:
            speed[3] = float("nan")
        if 54.0 < stiffness < 55.0:
            speed = speed[:-1]
        return [position + speed] if self.layout == "joined" else [position, speed, [0.0]]


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    server: Server

    def do_GET(self) -> None:
        self._answer({})

    def do_POST(self) -> None:
        self._answer(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))

    def _answer(self, body: dict[str, Any]) -> None:
        self.server.asked.append(self.path)
        if self.server.drop > 0:
            self.server.drop -= 1
            self.close_connection = True
            return
        if self.server.away > 0:
            self.server.away -= 1
            self._send(503, "no backend")
            return
        if self.path == "/moved/Info":
            self._send(302, "elsewhere")
            return
        try:
            found = self.server.answered(self.path, body)
        except RefusedError as error:
            self._send(error.status, json.dumps({"error": {"type": error.kind, "message": str(error)}}))
        except ArithmeticError as error:
            self._send(500, f"Internal Server Error: {error}")
        except (AssertionError, KeyError):
            self._send(404, "not found")
        else:
            self._send(200, str(found).replace("'", '"').replace("True", "true").replace("False", "false"))

    def _send(self, status: int, text: str) -> None:
        self.send_response(status)
        self.send_header("Content-Length", str(len(text)))
        if status == 302:
            self.send_header("Location", f"{self.server.url}/Info")
        self.end_headers()
        self.wfile.write(text.encode())

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Print nothing."""


@contextmanager
def serving() -> Iterator[Server]:
    """A server that runs as long as the context."""
    with Server() as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
