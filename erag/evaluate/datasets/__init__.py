"""The data sets that can be evaluated on, one module each: `NAME`, and `load(root, queries)`."""
