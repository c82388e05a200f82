"""Mutated CommonRoad files through everything that interdrive does with a file; see `python -m tests.fuzz`."""
