"""How the time of a long sweep shrinks with the processes that share it."""
