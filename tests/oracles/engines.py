"""The wing's equations of motion written independently, integrated by scipy and by Exudyn."""

from __future__ import annotations

from benchmarks.peers import compare, exudyn_engine, scipy_engine
from benchmarks.peers.equations import (
    SIZE,
    air_loads,
    at_rest,
    marker_tracks,
    put_rods,
    right_hand_side,
    sparsity,
    spring_loads,
)
from benchmarks.peers.wing import PeerWing, peer_wing, rod_motion

__all__ = [
    "SIZE",
    "PeerWing",
    "air_loads",
    "at_rest",
    "compare",
    "exudyn_engine",
    "marker_tracks",
    "peer_wing",
    "put_rods",
    "right_hand_side",
    "rod_motion",
    "scipy_engine",
    "sparsity",
    "spring_loads",
]
