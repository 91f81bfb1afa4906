"""Particles, lattices, solids, and the outlines of bodies."""
