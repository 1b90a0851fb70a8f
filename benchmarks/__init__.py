"""Benchmarks of the harness: CPU time of its parts and commands, held against bars and against earlier runs.

    python -m benchmarks                      all, beside the last run on this machine
    python -m benchmarks 'certified/*'        those whose names match
    python -m benchmarks --against main~3     both states of the code, measured in turns
    python -m benchmarks compare 4f1c9a2      the last run at a commit beside the last run
    python -m benchmarks list
    python -m benchmarks page                 docs/reference/costs.md from the last run

A benchmark is a ``Benchmark`` that a module in ``suites/`` yields; a new module is found by itself. Each suite runs in a process of its
own. What is judged is a ratio within one run: CPU time of the one call over that of another, timed in turns, so that a slow machine or a
busy neighbour meets both. Runs are appended to ``reports/benchmarks.jsonl``, which is not tracked: figures of one machine are no use on
another.

``benchmark`` is where to start reading; ``processes`` takes the CPU time of a command with all that it starts, ``running`` has the
processes of suites and other states of the code, ``history`` the runs, ``comparison`` the verdicts.
"""
