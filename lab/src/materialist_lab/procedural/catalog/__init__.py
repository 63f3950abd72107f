"""Models of real furniture and things, and photographs, from packages that are installed beside the project."""
