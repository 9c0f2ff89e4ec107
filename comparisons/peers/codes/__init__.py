"""The plate by one code each; a module here imports nothing of `comparisons`, so that another Python may run it."""
