"""Machine code of compiled functions as an object file that needs neither Python nor numba.

Numba compiles a function to a module of LLVM's code, in which all functions that it calls are contained. Here the parts
for Python are dropped, and LLVM writes an object file for any processor of the kind, not only for this one. Numba's
convention is int32 f(result*, error**, arguments...), with a nonzero value if memory is exhausted.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numba

# the oldest processors on which the code runs: any of the last fifteen years
PROCESSORS = {"x86_64": "x86-64-v2", "AMD64": "x86-64-v2"}
LANES = 2  # individuals that the kernels compute at a time: the fewest possible, both the same


class Exported(NamedTuple):
    """A function and the numba signature for which it is compiled."""

    function: Callable[..., Any]
    signature: Any


def processor() -> str:
    """Return LLVM's name of the oldest processor that the code is made for."""
    return PROCESSORS.get(platform.machine(), "generic")


def environment() -> dict[str, str]:
    """Return the environment of the process that calls :func:`object_file`."""
    return {
        **os.environ,
        "WINGFIT_LANES": str(LANES), "NUMBA_CPU_NAME": processor(), "NUMBA_CPU_FEATURES": "",
        "NUMBA_DISABLE_INTEL_SVML": "1", "NUMBA_DISABLE_JIT": "0",
    }  # fmt: skip


def object_file(functions: Mapping[str, Exported]) -> bytes:
    """Return an object file with the ``functions`` under the names that are their keys; no other is visible."""
    from llvmlite import binding as llvm

    modules = []
    for symbol, (function, signature) in functions.items():
        compiled = numba.njit(signature, fastmath={"contract"}, error_model="numpy", nogil=True)(function)
        result = compiled.overloads[signature.args]
        module = llvm.parse_bitcode(result.library._final_module.as_bitcode())
        for one in module.functions:
            if one.name == result.fndesc.llvm_func_name:
                one.name = symbol
        modules.append(module)
    whole = modules[0]
    for module in modules[1:]:
        whole.link_in(module)
    for one in [*whole.functions, *whole.global_variables]:
        if not one.is_declaration and one.name not in functions and not one.name.startswith("llvm."):
            one.linkage = "internal"
    target = llvm.Target.from_default_triple().create_target_machine(
        cpu=processor(), features="", opt=3, reloc="pic", codemodel="default"
    )
    passes = llvm.create_pass_builder(target, llvm.create_pipeline_tuning_options(3))
    passes.getModulePassManager().run(whole, passes)
    whole.verify()
    return bytes(target.emit_object(whole))
