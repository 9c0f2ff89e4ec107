"""Times of whole solves beside one factorisation and other loops, of sequences and walls, and the accuracy they buy."""
