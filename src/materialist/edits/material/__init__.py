"""Edits of albedo, roughness and metallic inside a region."""
