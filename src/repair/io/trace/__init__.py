"""Files of drawtonomy: what was planned, and what CommonRoad's own checker says of it."""
