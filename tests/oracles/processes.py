"""Servers and Ray nodes as processes of this machine, and what can be seen of them from outside."""

from __future__ import annotations

from benchmarks.common.files import EXAMPLES, REPOSITORY
from benchmarks.common.ray_node import IMPATIENT, MARK, Node, environment, free_port, marked
from benchmarks.common.server_process import Server

__all__ = ["EXAMPLES", "IMPATIENT", "MARK", "REPOSITORY", "Node", "Server", "environment", "free_port", "marked"]
