"""Forwards TCP connections to the server: ``python -m wingfit.service.operations.forward api:8321``.

In the containers only this process is on the published network. Ray listens on every interface, so the container of
the API, which holds a Ray node, must be on the internal network of the cluster only.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from contextlib import suppress

CHUNK_BYTES = 64 * 1024
CONNECT_SECONDS = 10.0


def main(arguments: list[str] | None = None) -> None:
    """Forward as the command line says (``arguments`` None: that of the process) until the process is ended."""
    parser = argparse.ArgumentParser(prog="python -m wingfit.service.operations.forward", description=__doc__)
    parser.add_argument("target", help="address to forward to, as host:port")
    parser.add_argument("--host", default="0.0.0.0", help="address to listen on (default: all)")  # noqa: S104  its purpose
    parser.add_argument("--port", type=int, default=8321, help="TCP port to listen on (default: 8321)")
    options = parser.parse_args(arguments)
    host, _, port = options.target.rpartition(":")
    if not host or not port.isdigit():
        parser.error(f"the target is {options.target!r}; write host:port, for example api:8321")
    with suppress(KeyboardInterrupt):
        asyncio.run(forward(options.host, options.port, host, int(port)))


async def forward(host: str, port: int, target_host: str, target_port: int) -> None:
    """Forward every connection made to ``host``:``port`` to ``target_host``:``target_port``, until cancelled."""

    async def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            await _connect_both(reader, writer, target_host, target_port)
        except OSError as error:
            print(f"cannot reach {target_host}:{target_port}: {error}", file=sys.stderr, flush=True)
        finally:
            writer.close()

    listening = await asyncio.start_server(connected, host, port)
    async with listening:
        await listening.serve_forever()


async def _connect_both(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, host: str, port: int) -> None:
    """Connect to ``host``:``port`` and copy in both directions until both sides have finished.

    ``reader`` and ``writer``: of the client's connection. OSError if the target cannot be reached.
    """
    target_reader, target_writer = await asyncio.wait_for(asyncio.open_connection(host, port), CONNECT_SECONDS)
    try:
        ways = (_copy(reader, target_writer), _copy(target_reader, writer))
        # If one side breaks the connection, the caller closes both.
        with suppress(ConnectionError):
            await asyncio.gather(*ways)
    finally:
        target_writer.close()


async def _copy(source: asyncio.StreamReader, target: asyncio.StreamWriter) -> None:
    """Copy until ``source`` ends, then close that direction of ``target``; the other direction stays open."""
    while chunk := await source.read(CHUNK_BYTES):
        target.write(chunk)
        await target.drain()
    target.write_eof()


if __name__ == "__main__":
    main()
