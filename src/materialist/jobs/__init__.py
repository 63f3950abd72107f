"""Long work in processes of their own. One protocol for the studio's jobs, its glass preview, and batches.

`worker` is the side of the process, `process.Worker` the side of whoever started it. `queue` runs the studio's jobs in
order, `pool` the photos of a batch. A task is an importable function `task(report, **arguments)`.
"""
