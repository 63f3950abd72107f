"""Relighting: environment map, sun, lamps, and emitters that the photo shows."""
