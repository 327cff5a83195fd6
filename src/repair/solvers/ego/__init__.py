"""The paper's planner: soft penalties on a uniform B-spline, in two stages."""
