"""Times of whole solves beside one factorisation, of sequences and walls, and the accuracy they buy."""
