"""Procedural shapes, patterns, scenes and lights, and the tracer that makes labelled pictures of them."""
