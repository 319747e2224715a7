"""Recording demonstrations in a terminal: keys, screens and the worlds behind them."""
