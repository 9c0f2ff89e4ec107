"""The compressed plate by displacement codes in the same run: accuracy for its cost beside the equilibrium model."""
