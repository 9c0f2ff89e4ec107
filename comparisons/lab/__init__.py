"""The framework of all experiments: runner and store of studies, tables, reports."""
