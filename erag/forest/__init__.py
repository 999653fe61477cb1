"""A map to a semantic forest: affinity, exact complete linkage, levels, forests given by the source."""
