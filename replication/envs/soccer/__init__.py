"""Robot soccer: the rules of a decision, the physics world, and its compiled twin."""
