"""emaphm."""
