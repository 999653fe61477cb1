"""Types, geometry, text, times and errors that every other layer shares."""
