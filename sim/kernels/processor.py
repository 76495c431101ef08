"""How many individuals the kernels compute at a time on this processor."""

from __future__ import annotations

import numba
from numba.core.codegen import get_host_cpu_features

from wingfit.sim.requested_lanes import requested_lanes


def lanes() -> int:
    """Return how many individuals to compute at a time, as many as fit the processor's vector registers.

    AVX-512 has 32 registers of eight floats: eight. AVX2 has 16 of four floats, NEON 32 of two: four, since with more
    the values of a body do not stay in registers. ValueError if the environment asks for a number that is not possible.
    """
    requested = requested_lanes()
    if requested is not None:
        return requested
    given = numba.config.CPU_FEATURES  # for which numba compiles; None: for this processor
    # numba's function leaves AVX out if NUMBA_ENABLE_AVX is 0, and returns "" where LLVM does not know the processor.
    features = get_host_cpu_features() if given is None else given
    return 8 if "+avx512f" in features.split(",") else 4
