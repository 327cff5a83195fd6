"""Why nothing works: what stands in the way, and the least that would have to be different."""
