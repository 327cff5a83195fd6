"""A result in motion."""
