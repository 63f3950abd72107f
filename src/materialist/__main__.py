"""`python -m materialist`."""

from materialist.cli import main

main()
