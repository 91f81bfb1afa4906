"""The engine: what it is told, and the one edge to it."""
