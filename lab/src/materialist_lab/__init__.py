"""The laboratory: scenes with known truth, the training of the networks, and the benchmarks.

It imports `materialist`, which never imports it; its commands join `materialist` through entry points.
"""
