"""The paper's baseline: a quadratic program of Bernstein pieces in a convex corridor."""
