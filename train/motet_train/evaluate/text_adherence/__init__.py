"""Does what it says: everyday prompts, and rules on joint positions that tell whether a motion is what was asked."""
