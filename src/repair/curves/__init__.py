"""Trajectories as curves over time: what a curve is, its kinds, their samples and their files."""
