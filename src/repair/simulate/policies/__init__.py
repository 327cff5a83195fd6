"""When the ego leaves its plan, each a small class behind one interface."""
