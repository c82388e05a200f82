"""SUMO as traffic: its vehicles and our agents decide on the same state and move at once."""
