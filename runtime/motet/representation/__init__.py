"""What the channels of a model mean: from a motion to frames, and from frames to a motion that can be played."""
