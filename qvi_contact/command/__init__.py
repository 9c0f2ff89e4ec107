"""The command `qvi-contact`: options, reports, outlines of problems."""
