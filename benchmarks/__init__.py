"""Benchmarks: accuracy over the bound, honesty of the uncertainty, and time, beside peers.

One core per process, set here because NumPy reads it once, when it is first imported.
"""

import os

for _library in ("OPENBLAS", "MKL", "OMP", "NUMEXPR"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")  # jax
