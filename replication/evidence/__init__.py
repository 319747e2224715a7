"""From trials to tables, verdicts and what they depend on."""
