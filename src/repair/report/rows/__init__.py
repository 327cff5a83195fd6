"""Rows of the account of a result, by what they are about."""
