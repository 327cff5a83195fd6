"""The proof that it is too late, checked from the files: nothing here is shared with who made it."""
