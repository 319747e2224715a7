"""Tasks of a user's own: tables, and Gymnasium environments with or without one."""
