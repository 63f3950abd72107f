"""Closed bodies from one view: the visible front, its thickness, surfaces of revolution."""
