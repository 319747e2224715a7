"""From notebooks to published files. It knows no science."""
