"""Independent reference solutions that the product is judged by, and the only way from tests into ``benchmarks``.

A module here either holds a reference that only tests use (closed forms, printed equations, other integrators), or
re-exports one that benchmarks use too. ``tests/benchmarks``, which tests the benchmarks, imports them directly.
``tests/test_imports.py`` checks it.
"""
