"""The loaded pin of NAFEMS by displacement codes beside this package: same mesh, same law, numbers side by side."""
