"""Many seeds of many conditions, each trial computed once and stored."""
