"""What the paper says, and the register of what it leaves open."""
