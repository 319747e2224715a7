"""Q-learning (Eq. 1): the definition in plain Python, and compiled with the same bits."""
