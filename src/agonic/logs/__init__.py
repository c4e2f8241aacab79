"""Recordings of all kinds as `Samples`: a module for each kind, all listed in `formats`.

Another kind of file:
1. `NAME.py`, here or in the folder of its kind, with `read_tables(path) -> Found`: tables of named
   columns, which `groups.build_tables_log` takes for columns, units, clocks and sensors; or with
   `read(path, source, unit=None) -> Log` where it holds something else;
2. a row of `formats.toml` with the mark by which the first bytes are known;
3. the kind's name in `docs/jobs/read-a-log.md`. `tests/logs/test_formats.py` says what is missing.
"""
