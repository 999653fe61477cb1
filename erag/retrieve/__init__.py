"""A forest and a query to hits: flat retrievers, the tree, location, sensors and time."""
