"""Golden numbers: what the package answers today, so that a move of the code can be told from a change of its answers.

    python -m tests.golden                compare every number, and say which is off
    python -m tests.golden ring press     those of the problems whose name contains one of these words
    python -m tests.golden --write        compute them anew and write `numbers.json`

`problems.py` says what is computed, `numbers.json` holds the numbers. Each has the distance `within` that it may move:
30 times the spread of four runs, with three kernels of OpenBLAS and with a tenth of the solver's tolerance, but at
least 1e-9 of the largest number of its kind (forces, stresses, energies, lengths, factors). Statuses are compared as
they are, iterations may differ by 2. A step that changes a number says so, and why, in its commit.
"""
