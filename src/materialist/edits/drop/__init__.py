"""Rigid bodies that fall onto the photographed scene."""
