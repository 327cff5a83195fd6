"""The cut-in, cut-out and deceleration cases of UN Regulation No. 157, and the driver models it names."""
