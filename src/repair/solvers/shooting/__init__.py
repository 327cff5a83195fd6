"""Direct shooting: controls of the vehicle drawn at random, driven, and drawn again around the best."""
