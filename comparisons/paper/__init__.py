"""The paper's plate: printed numbers, the computations beside them, and the report."""
