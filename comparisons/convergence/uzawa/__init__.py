"""The iteration of Uzawa of Więckowski (1992): how large its steps may be, and how many it takes."""
