"""The closed loop: the ego drives among recorded traffic, and a policy says when it leaves its plan."""
