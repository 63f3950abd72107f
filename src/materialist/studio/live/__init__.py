"""The live preview of an open photo: its process, and what is made of it there."""
