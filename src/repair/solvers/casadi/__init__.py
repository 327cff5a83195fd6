"""The hard planner: the uniform B-spline as an NLP, its constraints kept by the convex hull."""
