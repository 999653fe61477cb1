"""The memory file: observations, vectors, forest generations and call records in one SQLite file."""
