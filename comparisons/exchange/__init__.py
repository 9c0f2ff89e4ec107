"""Problems in formats of other programs (`qpbenchmark`, FCLIB, NumPy archives), and their files solved here."""
