"""Ingest, build, query: the three steps over a memory file, for the command line, Python and experiments."""
