"""Golden numbers: answers of the package today, by which a change of code that should change no answer is tested.

    python -m tests.golden                compare every number, and print those that differ
    python -m tests.golden ring press     only problems whose name contains one of these words
    python -m tests.golden --write        compute the numbers anew and write `numbers.json`

`problems.py` computes the numbers, `numbers.json` stores them. Each number has its tolerance `within`:
30 times the spread of four runs, with three kernels of OpenBLAS and with a tenth of the solver's tolerance, but at
least 1e-9 of the largest number of its kind (forces, stresses, energies, lengths, factors). Statuses have to be equal,
iterations may differ by 2. A commit that changes a number says so, and why.
"""
