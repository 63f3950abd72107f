"""Scenes of real things: rooms, laid tables, single things and sculptures."""
