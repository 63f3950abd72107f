"""The studio: the public API on a web page, for people who never open a terminal. It holds no logic of its own.

A page (`page`, `tab_*`) turns clicks into calls of a `session.Session`; what takes long runs as a `jobs.Job` in a
process of its own (`worker`), which can be stopped at any time. Scenes and edits lie in a `work.WorkFolder`.
"""
