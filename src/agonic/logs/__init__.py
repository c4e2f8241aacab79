"""Recordings of all kinds as `Samples`: a module for each kind, all listed in `formats`.

Another kind of file:
1. `NAME.py`, here or in the folder of its kind, with `read(path, source, unit=None) -> Log`; a
   table of named columns goes through `table.build_log`, which knows columns, units, clocks and
   sensors;
2. a row of `formats.toml` with the mark by which the first bytes are known;
3. the kind's name in `docs/jobs/read-a-log.md`. `tests/logs/test_formats.py` says what is missing.
"""
