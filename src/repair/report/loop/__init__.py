"""What is shown of the closed loop."""
