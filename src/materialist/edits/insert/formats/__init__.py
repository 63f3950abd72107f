"""Readers of mesh files, one for each format; they look at counts and sizes before they take memory."""
