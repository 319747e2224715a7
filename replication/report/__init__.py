"""What a reader sees: figures, tables in words, players and findings."""
