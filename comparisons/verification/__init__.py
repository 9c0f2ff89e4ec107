"""The verification manual: problems whose answer is known otherwise, row by row beside what the package computes."""
