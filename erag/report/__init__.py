"""A memory and its answers as one self-contained HTML page: no link, no request, nothing beside the file."""
