"""Documents in and out: problem files, archives of results, VTU."""
