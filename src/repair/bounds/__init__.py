"""How late is too late: a bound on the time to react, with a proof by exhaustion (docs/bound.md)."""
