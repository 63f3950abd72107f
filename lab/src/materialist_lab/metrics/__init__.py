"""Figures that only benchmarks and training need: how good predicted maps are, and LPIPS."""
