"""How sharp the tests are: a seeded sample of mutations of the source, and which of them the tests notice.

``python -m tests.mutations sample`` draws the sample, ``python -m tests.mutations cover`` runs the suite once and keeps
which test passes which line, and how long it takes, and ``python -m tests.mutations run NAME`` tries each mutation of
``sample.csv`` and keeps the answers in its column ``NAME``. Needs ``pip install cosmic-ray pytest-cov``.

A mutation changes an operator, comparison, number or truth value (operators of Cosmic Ray). It is tried on the tests
that pass its line, the quickest first, up to `SECONDS` of tests. A test that fails or does not end
notices it, so the share that is noticed is a lower bound for the whole suite.

``python -m tests.mutations renew`` follows the code: lines that moved to another file keep their
answers, and for each line that is gone another mutation is drawn near it, which has none until it is run.

The column `noticed` was measured at commit ad753419, and then for lines drawn anew and where tests became sharper,
the last on 29 November 2026, with test files of the same part of the code in place of those that `cover` finds: 247 of
320 were noticed, 182 of 221 in qvi_contact, 36 of 58 in solvers, 29 of 41 in comparisons. Most of the others change
nothing, or are data of studies; of some, tests beyond `SECONDS` notice them.
"""
