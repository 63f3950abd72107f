"""Figures that only benchmarks and training need: how good predicted maps and lights are, and LPIPS."""
