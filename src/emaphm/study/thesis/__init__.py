"""What the thesis printed, and its studies made again."""
