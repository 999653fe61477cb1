"""Did the robot get there? A simulated local planner on the map, apart from whether it was the right place."""
