"""Times of whole solves beside those of one factorisation, of other loops, and the accuracy that they buy."""
