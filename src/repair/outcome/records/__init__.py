"""Parts of the record."""
