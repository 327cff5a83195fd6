"""Many drives: files, plans, shifts, predictions and policies."""
