"""What the ego believes of the others, each a small class behind one interface."""
