"""From a CommonRoad scenario to what the search needs to know of it."""
