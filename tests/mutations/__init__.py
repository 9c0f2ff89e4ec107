"""How sharp the tests are: a seeded sample of mutations of the source, and which of them the tests notice.

``python -m tests.mutations sample`` draws the sample, ``python -m tests.mutations cover`` runs the suite once and keeps
which test passes which line, and how long it takes, and ``python -m tests.mutations run NAME`` tries each mutation of
``sample.csv`` and keeps the answers in its column ``NAME``. Needs ``pip install cosmic-ray pytest-cov``.

A mutation changes an operator, comparison, number or truth value (operators of Cosmic Ray). It is tried on the tests
that pass its line, the quickest first, up to `SECONDS` of tests. A test that fails or does not end
notices it, so the share that is noticed is a lower bound for the whole suite.

``python -m tests.mutations renew`` follows the code: lines that moved to another file keep their
answers, and for each line that is gone another mutation is drawn near it, which has none until it is run.

The column `noticed` was measured at commit ad753419, and since then for lines drawn anew. On 27 November 2026 all that
were not noticed or not tried were tried at 54b133cd, and again with the tests written because of them where these could
matter; of 60 that had been noticed, by chance, 59 were again. 242 of 320 were noticed, which are 181 of 221 in
qvi_contact, 34 of 58 in solvers, and 27 of 41 in comparisons, where most of the others are data of studies; before
these tests it were 237. At 0976734f the sample was renewed: 15
lines were drawn anew. Of a sample of commit 88a1bf8, drawn in the same way, about 215 of 320 were: 200 for certain, 34
not, and 86 were not tried with all its tests.
"""
