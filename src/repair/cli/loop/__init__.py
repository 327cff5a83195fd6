"""Verbs of the closed loop."""
