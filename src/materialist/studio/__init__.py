"""The studio: the public API on a web page, for people who never open a terminal. It holds no logic of its own.

A page (`page`, `tab_*`) turns clicks into calls of a `session.Session`; what takes long is a function of `tasks` that
`jobs` runs in a process of its own, which can be stopped at any time. Scenes and edits lie in a `workspace.WorkFolder`.
"""
