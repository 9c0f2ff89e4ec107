"""How much a sequence of problems costs that share a factorisation, from warm and from cold starts."""
