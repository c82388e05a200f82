"""Rows of known planners, one file per set."""
