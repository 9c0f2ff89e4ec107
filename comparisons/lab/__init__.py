"""The framework of all experiments: runner and store of studies, tables, reports."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "cells": ("is_numeric", "number_in", "position", "sort_key"),
        "machine": ("versions",),
        "ratios": ("growth", "spread"),
        "tables": ("Grid", "crossed", "grid_of", "markdown_table", "print_table", "rich_table"),
    },
)
