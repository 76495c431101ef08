"""Servers and Ray nodes as processes of this machine, and what can be seen of them from outside."""

from __future__ import annotations

from benchmarks.common.ray_nodes import IMPATIENT, MARK, REPOSITORY, Node, environment, free_port, marked
from benchmarks.common.server_process import Server

EXAMPLES = REPOSITORY / "examples"

__all__ = ["EXAMPLES", "IMPATIENT", "MARK", "REPOSITORY", "Node", "Server", "environment", "free_port", "marked"]
